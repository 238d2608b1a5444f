"""Compile the C sources of an FMU for any platform with zig.

The compiling tool provides the headers of the FMI standard, as the standard requires; here they come from FMPy.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from gossamer_files.options import option
from gossamer_models import ParameterError
from gossamer_models.compiler import compile_shared, kept_library, require_compiler

from .catalogue import package_folder
from .description import FmiVersion


@dataclass(frozen=True, slots=True, kw_only=True)
class Platform:
    """A platform for binaries.

    Attributes
    ----------
    suffix : str
        Of a shared library.
    targets : dict
        zig's target by folder below ``binaries/`` in FMI 3.0, one per processor.
    in_fmi_2 : bool
        Whether FMI 2.0 has the platform; FMI 2.0 puts all processors of a platform into one folder.
    """

    suffix: str
    targets: dict[str, str]
    in_fmi_2: bool = True


# By folder below binaries/ in FMI 2.0.
PLATFORMS = {
    "linux64": Platform(suffix=".so", targets={"x86_64-linux": "x86_64-linux-gnu.2.17"}),
    "win64": Platform(suffix=".dll", targets={"x86_64-windows": "x86_64-windows-gnu"}),
    "darwin64": Platform(
        suffix=".dylib", targets={"x86_64-darwin": "x86_64-macos.11.0", "aarch64-darwin": "aarch64-macos.11.0"}
    ),
    "aarch64-linux": Platform(suffix=".so", targets={"aarch64-linux": "aarch64-linux-gnu.2.17"}, in_fmi_2=False),
}
_PROCESSORS = {"amd64": "x86_64", "arm64": "aarch64"}  # other names of the same processors


def choose_platforms(names: Iterable[str], fmi: FmiVersion) -> list[str]:
    """Return the platforms to build for: those named, all of them, or by default the one that this program runs on.

    Raises
    ------
    ParameterError
        A platform is unknown, or is not part of this version of the standard.
    """
    names = list(names) or [_this_platform()]
    possible = [name for name, each in PLATFORMS.items() if fmi == 3 or each.in_fmi_2]
    for name in names:
        if name != "all" and name not in possible:
            msg = f"FMUs of FMI {fmi}.0 cannot be built for {name!r}; choose from {', '.join(possible)} and all."
            if name in PLATFORMS:
                msg = f"FMUs can be built for {name!r} only with {option('fmi', 3)}."
            raise ParameterError(msg)
    return possible if "all" in names else names


def fmi_headers() -> Path:
    """Return the folder of the FMI standard's headers."""
    return package_folder("fmpy") / "c-code"


def compile_library(
    files: dict[str, bytes], name: str, fmi: FmiVersion, platform: str, begin: Callable[[], None] = lambda: None
) -> dict[str, bytes]:
    """Compile C sources for one platform.

    Parameters
    ----------
    files : dict
        As from ``c_code.sources``.
    name : str
        Of the library, without ending.
    fmi : {2, 3}
        Version of the standard.
    platform : str
        A key of ``PLATFORMS``; see ``choose_platforms``.
    begin : callable
        Called before something is compiled; a library in the cache is not.

    Returns
    -------
    dict
        Libraries by path in the FMU; the same sources and compiler give the same bytes.

    Raises
    ------
    ModuleNotFoundError
        The compiler is not installed.
    """
    require_compiler("native FMUs")
    file = f"{name}{PLATFORMS[platform].suffix}"
    targets = PLATFORMS[platform].targets
    libraries = {place: _compile(files, f"fmi{fmi}.c", file, target, begin) for place, target in targets.items()}
    if fmi == 2:
        libraries = {platform: universal(list(libraries.values()))}
    return {f"binaries/{place}/{file}": content for place, content in libraries.items()}


def universal(libraries: list[bytes]) -> bytes:
    """Join Mach-O libraries for several processors into one file; a single one stays as it is.

    Notes
    -----
    Apple's ``fat_header`` (mach-o/fat.h): big-endian magic and count, then processor type and subtype, offset, size and
    alignment of each library; the types are the second and third word of a Mach-O file.
    """
    if len(libraries) == 1:
        return libraries[0]
    alignment = 14
    page = 1 << alignment
    head = struct.pack(">II", 0xCAFEBABE, len(libraries))
    body = b""
    for library in libraries:
        processor, subtype = struct.unpack_from("<II", library, 4)
        head += struct.pack(">5I", processor, subtype, page + len(body), len(library), alignment)
        body += library + bytes(-len(library) % page)
    return head.ljust(page, b"\0") + body


def _compile(files: dict[str, bytes], source: str, library: str, target: str, begin: Callable[[], None]) -> bytes:
    options = ["-target", target, *([] if "windows" in target else ["-lm"])]
    headers = [path.read_bytes() for path in sorted(fmi_headers().glob("*.h"))]
    named = [part for name, content in sorted(files.items()) for part in (name, content)]

    def compile_it() -> bytes:
        begin()
        return compile_shared(files, source, library, [*options, "-I", str(fmi_headers())], target)

    what = f"{library} for {target}"
    return kept_library([source, library, *options, *headers, *named], Path(library).suffix, compile_it, what).read_bytes()


def _this_platform() -> str:
    import platform

    machine = platform.machine().lower()
    folder = f"{_PROCESSORS.get(machine, machine)}-{platform.system().lower()}"
    return next((name for name, each in PLATFORMS.items() if folder in each.targets), folder)
