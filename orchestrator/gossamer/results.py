"""What a result has: sentences, tables, a picture, JSON. It prints, draws and serialises itself from them, once."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from gossamer_files.tables import TableText

if TYPE_CHECKING:
    import xarray as xr
    from gossamer_files.charts import Chart
    from rich.console import Console
    from rich.table import Table

INVALID = 3  # exit code: all went well, and the judgement is not valid
_PERCENT = ("all_zones", "damaged_zones", "error_all", "error_damaged")  # the others are ratios
_WIDTH = 160  # characters of a table in a notebook
_CODE = '<pre style="white-space:pre;overflow-x:auto;line-height:normal">{code}</pre>'


class Result:
    """What a command found; a subclass says what it has of this.

    Attributes
    ----------
    files : sequence of Path
        What was written, in the order in which the command line prints it; the page last.
    """

    files: Sequence[Path] = ()
    TABLES: ClassVar[Literal["stdout", "stderr", "told"]] = "stderr"  # where the command line prints them, if not yet told
    PLACE: ClassVar[str] = ""  # what a notebook shows last of a result that is a path, which stands for {}

    @property
    def page(self) -> Path | None:
        """The page; None where none was written."""
        from gossamer_orchestrator.pages import PAGE

        return next((path for path in self.files if path.name == PAGE), None)

    @property
    def sentence(self) -> str:
        """What was found."""
        return ""

    def exit_code(self) -> int:
        """Return the exit code of the command."""
        return 0

    def lines(self) -> list[str]:
        """Return sentences that the command line prints below the tables."""
        return []

    def doubts(self) -> list[str]:
        """Return reasons for doubt."""
        return []

    def more(self) -> list[str]:
        """Return what a notebook shows below the first sentence."""
        return [*self.lines(), *self.doubts(), *[self.PLACE.format(self)] * bool(self.PLACE)]

    def hints(self) -> list[str]:
        """Return what to type next, for the command line."""
        page = self.page
        return [] if page is None else [f"Open {page}, or type 'gossamer view {typed(page.parent)}'."]

    def tables(self) -> Sequence[TableText | Table | str]:
        """Return tables, or a text where a table would be too long to lay out."""
        return []

    def picture(self) -> bytes | None:
        """Return a PNG file."""
        return None

    def to_json(self) -> dict[str, Any]:
        """Return all as JSON: keys end in the unit (``time_s``), ratios have none, or ``units`` stands beside them."""
        return {"files": self.files}

    def __repr__(self) -> str:
        place = f"{str(self)!r}: " if hasattr(self, "__fspath__") else ""
        return f"{type(self).__name__}({place}{self.sentence})"

    def __str__(self) -> str:
        return self.__fspath__() if hasattr(self, "__fspath__") else self.__repr__()

    def _repr_html_(self) -> str:
        """Return HTML for a notebook that needs nothing else: sentences, tables as ``rich`` prints them, the picture."""
        from rich.console import Console

        console = Console(record=True, file=io.StringIO(), width=_WIDTH, force_jupyter=False, force_terminal=False)
        print_tables(console, self.tables())
        parts = [f"<p><strong>{escape(self.sentence)}</strong></p>", *(f"<p>{escape(each)}</p>" for each in self.more())]
        if console.file.getvalue().strip():  # type: ignore[attr-defined]
            parts.append(console.export_html(inline_styles=True, code_format=_CODE))
        if (picture := self.picture()) is not None:
            coded = base64.b64encode(picture).decode()
            parts.append(f'<img style="max-width:100%" alt="{escape(self.sentence)}" src="data:image/png;base64,{coded}">')
        return f"<div>{''.join(parts)}</div>"


@dataclass(frozen=True, kw_only=True, repr=False)
class Saved(Result):
    """A result that is a path: that of the first of its files."""

    files: Sequence[Path]

    @property
    def path(self) -> Path:
        """The file."""
        return self.files[0]

    def __fspath__(self) -> str:
        return str(self.path)


def print_tables(console: Console, tables: Iterable[TableText | Table | str]) -> None:
    """Print tables; those without rows are left out."""
    from rich.markup import escape as marked
    from rich.table import Table

    for each in tables:
        if isinstance(each, TableText):
            table = Table(*map(marked, each.head), caption=marked(each.caption))
            for row in each.rows:
                table.add_row(*map(marked, row))
            if each.rows:
                console.print(table)
        elif isinstance(each, str):
            console.print(each, markup=False, highlight=False, soft_wrap=True)
        else:
            console.print(each)


def typed(path: Path) -> str:
    """Return a path as it is typed in a command."""
    return f'"{path}"' if " " in str(path) else str(path)


def first_of(files: Iterable[Path], ending: str) -> bytes | None:
    """Return the content of the first file that is there of those whose names end so."""
    path = next((path for path in files if path.name.endswith(ending) and path.is_file()), None)
    return None if path is None else path.read_bytes()


def zone_coordinates(names: Sequence[str]) -> dict[str, Any]:
    """Return the coordinates of zones: numbers and names; of a square of side 1 also rows and columns."""
    import numpy as np
    from gossamer_orchestrator.results.places import zone_places

    count = len(names)
    found: dict[str, Any] = {"zone": np.arange(1, count + 1), "name": ("zone", list(names))}
    numbered = tuple(names) == tuple(f"zone_{k + 1}" for k in range(count))
    side = math.isqrt(count)
    return (zone_places(side, 1.0, {"units": "1"}) if numbered and side**2 == count else {}) | found


def as_png(chart: Chart, size: tuple[float, float] = (4.7, 4.4)) -> bytes:
    """Return a chart, drawn in a size [inch], as a PNG file."""
    from gossamer_files.pictures import picture
    from gossamer_files.plots import draw

    target = io.BytesIO()
    with picture(target, size) as figure:
        draw(chart, figure.subplots())
    return target.getvalue()


def by_label(dims: tuple[str, ...], rows: Iterable[tuple[tuple[Any, ...], Mapping[str, float]]]) -> xr.Dataset:
    """Return rows of values by name along their keys, in the order of the rows; not a number where there is none."""
    import numpy as np
    import xarray as xr

    listed = list(rows)
    labels = {dim: list(dict.fromkeys(key[k] for key, _ in listed)) for k, dim in enumerate(dims)}
    arrays: dict[str, Any] = {}
    for key, values in listed:
        place = tuple(labels[dim].index(label) for dim, label in zip(dims, key, strict=True))
        for name, value in values.items():
            empty = np.full([len(each) for each in labels.values()], math.nan)
            arrays.setdefault(name.replace(" ", "_"), empty)[place] = value
    units = {name: {"units": "%" if name in _PERCENT else "1"} for name in arrays}
    return xr.Dataset({name: (dims, values, units[name]) for name, values in arrays.items()}, coords=labels)
