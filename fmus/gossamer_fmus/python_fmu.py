"""The files of an FMU that runs in Python: pythonfmu's library, one generic slave, and the serialized step model.

Laid out as pythonfmu 0.7.0 does it (its own builder stamps times and random identifiers, and leaves the module search path
changed)::

    binaries/<platform>/<name>.<so|dll>      pythonfmu's library, which starts Python
    resources/slavemodule.txt                names the slave
    resources/slave_<digest>.py              imports the slave from the package
    resources/step_<digest>/                 the slave and what it imports: the stepper and pythonfmu's base class
    resources/model.json, init.casadi, step.casadi
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from tempfile import TemporaryDirectory

from gossamer_models import StepModel

from .catalogue import package_folder

_STEP_FILES = ("errors.py", "variables.py", "step_model.py", "stepper.py")
_PYTHONFMU_FILES = ("_version.py", "default_experiment.py", "enums.py", "fmi2slave.py", "logmsg.py", "variables.py")
# pythonfmu 0.7.0 runs this text again for every instance: whatever it defined would stay in memory each time. It also drops
# a reference to the module's globals that it never took; without the one added here they would be freed under the host.
_ENTRY = """import ctypes

from {package}.slave import GossamerSlave

ctypes.pythonapi.Py_IncRef(ctypes.py_object(globals()))
"""


def python_members(model: StepModel) -> dict[str, bytes]:
    """Return the files below ``binaries/`` and ``resources/`` by path."""
    members = {f"resources/{name}": data for name, data in _resources(model).items()}
    for library in sorted((package_folder("pythonfmu") / "resources/binaries").rglob("*.*")):
        members[f"binaries/{library.parent.name}/{model.name}{library.suffix}"] = library.read_bytes()
    return members


def _resources(model: StepModel) -> dict[str, bytes]:
    models, pythonfmu = package_folder("gossamer_models"), package_folder("pythonfmu")
    roots = package_folder("gossamer_files") / "errors.py"
    slave = Path(__file__).with_name("slave.py").read_text(encoding="utf-8")
    code = {"__init__.py": b"", "pythonfmu/__init__.py": b""}
    code |= {name: (models / name).read_bytes() for name in _STEP_FILES} | {"roots.py": roots.read_bytes()}
    code["errors.py"] = code["errors.py"].replace(b"from gossamer_files.errors ", b"from .roots ")
    code |= {f"pythonfmu/{name}": (pythonfmu / name).read_bytes() for name in _PYTHONFMU_FILES}
    content = b"\0".join([model.digest.encode(), slave.encode(), _ENTRY.encode(), *code.values()])
    digest = hashlib.sha256(content).hexdigest()[:16]
    package = f"step_{digest}"
    slave = slave.replace("from gossamer_models.", f"from {package}.")
    slave = slave.replace("from pythonfmu.", f"from {package}.pythonfmu.")
    files = {f"{package}/{name}": data for name, data in code.items()}
    files[f"{package}/slave.py"] = slave.encode()
    files[f"slave_{digest}.py"] = _ENTRY.format(package=package).encode()
    files["slavemodule.txt"] = f"slave_{digest}".encode()
    with TemporaryDirectory() as temporary:
        model.save(Path(temporary))
        files |= {path.name: path.read_bytes() for path in Path(temporary).iterdir()}
    return files
