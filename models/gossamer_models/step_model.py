"""A model as one pure step and one table of variables.

Symbols: ``x`` state, ``u`` inputs, ``p`` parameters, ``y`` outputs and locals, ``h`` step [s]::

    init(u, p)       -> (x, y)         once, when initialization ends
    step(x, u, p, h) -> (x_next, y)    u holds at the end of the step

Both are CasADi functions without side effects; ``x`` is all that a model remembers. Python stepping, FMUs, derivatives
and identification come from this one definition. ``StepModel.written`` makes both from functions that take ``u`` and
``p`` by the names of the table. This file and its neighbours ``errors.py``, ``variables.py`` and ``stepper.py`` travel
inside the FMUs, so they import nothing but NumPy, CasADi and the standard library.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import casadi as ca

from .errors import ArtifactError, ParameterError, require
from .variables import CAUSALITIES, Causality, Results, State, Values, Variable, by_name, in_order, pack, unpack

if TYPE_CHECKING:
    from .arrays import Matrix
    from .element_loop import Tables  # stays behind when this file travels

FORMAT_VERSION = 1
_KEPT = ("name", "description", "step_limit", "restarted", "residual", "advice", "provenance")  # as they are, in a card


@dataclass(frozen=True, kw_only=True)
class Rest:
    """Where a model of displacements is at rest, for those who find that without ``init``.

    Attributes
    ----------
    begin : casadi.Function
        ``begin(u, p, q) -> (x, y)``: state and results at rest with displacements q [m], which are the first states.
    finder : callable or None
        Returns ``find(u, p) -> q`` for one row per case; a row is not a number where there is no rest. None: ``init`` finds
        it without an iteration that could run away, in batches too.
    """

    begin: ca.Function
    finder: Callable[[], Callable[[Matrix, Matrix], Matrix]] | None


@dataclass(frozen=True, kw_only=True)
class StepModel:
    """A pure step, its initialization and the table of its variables.

    Attributes
    ----------
    name : str
        Identifier, for instance ``sensor``.
    description : str
        One line.
    variables : tuple of Variable
        Parameters, inputs, outputs and locals, in this order; ``y`` is outputs followed by locals.
    init, step : casadi.Function
        ``init(u, p) -> (x, y)`` and ``step(x, u, p, h) -> (x_next, y)``; dense column vectors.
    step_limit : str or None
        Name of the variable that holds the largest internal step [s]; longer communication steps are divided.
    restarted : int
        How many of the last states are set to zero when a communication step begins, which may be divided: what is
        counted from there, as for a mean over the step.
    residual : int or None
        State that tells, where ``init`` gives others that are not a number, how many times too large the forces are that
        are left.
    advice : str
        What to check when a result is not finite; ends the error message.
    provenance : dict
        Where identified or trained numbers come from.
    tables : element_loop.Tables or None
        Arrays that both functions take as one more input; such a model is for compiled code only.
    expression : callable or None
        Of a model with tables: returns the same model without, of which derivatives can be taken.
    compiled : callable or None
        Of a model without tables: returns the same model with loops over tables, for compiled code.
    at_rest : Rest or None
        Of a model of displacements.
    resources : dict
        Files by name that an FMU of the model carries beside it, for programs that draw it; no part of ``card``.
    """

    name: str
    description: str
    variables: tuple[Variable, ...]
    init: ca.Function
    step: ca.Function
    step_limit: str | None = None
    restarted: int = 0
    residual: int | None = None
    advice: str = "Check the parameters and the inputs."
    provenance: dict[str, str] = field(default_factory=dict)
    tables: Tables | None = None
    expression: Callable[[], StepModel] | None = None
    compiled: Callable[[], StepModel] | None = None
    at_rest: Rest | None = None
    resources: dict[str, bytes] = field(default_factory=dict)

    def __post_init__(self) -> None:
        order = [CAUSALITIES.index(v.causality) for v in self.variables]
        require(order == sorted(order), f"model {self.name!r}: list parameters, inputs, outputs and locals in this order")
        require(len(set(self.names)) == len(self.names), f"model {self.name!r}: two variables have the same name")
        n_p, n_u = self.count("parameter"), self.count("input")
        n_y, n_x = len(self.variables) - n_p - n_u, self.n_states
        n_t = [] if self.tables is None else [self.tables.numbers.size]
        expected = {
            "init": ([n_u, n_p, *n_t], [n_x, n_y], self.init),
            "step": ([n_x, n_u, n_p, 1, *n_t], [n_x, n_y], self.step),
        }
        for label, (n_in, n_out, function) in expected.items():
            shape_in = [function.nnz_in(i) for i in range(function.n_in())]
            shape_out = [function.nnz_out(i) for i in range(function.n_out())]
            if (shape_in, shape_out) != (n_in, n_out):
                msg = f"model {self.name!r}: {label} is {shape_in} -> {shape_out}, but its table requires {n_in} -> {n_out}"
                raise ParameterError(msg)
        if self.step_limit is not None and self.step_limit not in self.names:
            msg = f"model {self.name!r}: no variable {self.step_limit!r} to limit the step"
            raise ParameterError(msg)

    @classmethod
    def written(
        cls,
        *,
        variables: tuple[Variable, ...],
        init: Callable[[Values, Values], tuple[State, Results]],
        step: Callable[[State, Values, Values, ca.MX], tuple[State, Results]],
        begin: Callable[[ca.MX, Values, Values], tuple[State, Results]] | None = None,
        n_q: int = 0,
        finder: Callable[[], Callable[[Matrix, Matrix], Matrix]] | None = None,
        table_column: ca.MX | None = None,
        **rest: Any,  # noqa: ANN401
    ) -> StepModel:
        """Trace a model that is written with the names of its table.

        Parameters
        ----------
        variables : tuple of Variable
            The table.
        init : callable
            ``init(u, p) -> (x, results)``: attributes of ``u`` and ``p`` are the inputs and parameters, arrays as
            columns; ``x`` is a column or a dataclass of columns and dataclasses; ``results`` holds the outputs and
            locals by name, arrays as columns.
        step : callable
            ``step(x, u, p, h) -> (x_next, results)`` with states as ``init`` returns them.
        begin, n_q, finder : optional
            Of a model of n_q displacements: ``begin(q, u, p) -> (x, results)``, and the last attribute of ``Rest``.
        table_column : casadi.MX, optional
            Symbol for ``tables.numbers`` that both use.
        **rest
            The other attributes of the model.

        Raises
        ------
        ParameterError
            The results are not those of the table.
        """
        rows = {c: [v for v in variables if v.causality == c] for c in CAUSALITIES}
        results = [*rows["output"], *rows["local"]]
        u, p = ca.MX.sym("u", len(rows["input"])), ca.MX.sym("p", len(rows["parameter"]))
        inputs, parameters = by_name(rows["input"], u), by_name(rows["parameter"], p)
        x0, y0 = init(inputs, parameters)
        x, h = ca.MX.sym("x", pack(x0).numel()), ca.MX.sym("h")
        x_next, y = step(unpack(x0, x), inputs, parameters, h)
        t = [] if table_column is None else [table_column]
        at_rest = None
        if begin is not None:
            q = ca.MX.sym("q", n_q)
            x_q, y_q = begin(q, inputs, parameters)
            at_rest = Rest(begin=ca.Function("begin", [u, p, q, *t], [pack(x_q), in_order(results, y_q)]), finder=finder)
        return cls(
            variables=variables,
            at_rest=at_rest,
            init=ca.Function("init", [u, p, *t], [pack(x0), in_order(results, y0)]),
            # what a model and its parts compute alike, such as the decay of the modes, is computed once
            step=ca.Function("step", [x, u, p, h, *t], ca.cse([pack(x_next), in_order(results, y)])),
            **rest,
        )

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all variables in table order."""
        return tuple(v.name for v in self.variables)

    def elements(self, array: str) -> tuple[str, ...]:
        """Names of the elements of an array of variables, in order."""
        return tuple(name for name in self.names if name.startswith(f"{array}["))

    @property
    def n_states(self) -> int:
        """Number of states."""
        return int(self.step.nnz_in(0))

    def count(self, causality: Causality) -> int:
        """Count the variables of one causality."""
        return sum(v.causality == causality for v in self.variables)

    def slices(self) -> tuple[slice, slice, slice]:
        """Return where parameters, inputs and results (outputs and locals) lie in the table."""
        n_p, n_u = self.count("parameter"), self.count("input")
        return slice(0, n_p), slice(n_p, n_p + n_u), slice(n_p + n_u, len(self.variables))

    @cached_property
    def card(self) -> str:
        """The table and everything else but the functions, whose digests it holds, as JSON."""
        digests = {name: _digest(function.serialize()) for name, function in self._functions.items()}
        if self.tables is not None:
            digests["tables"] = hashlib.sha256(self.tables.content()).hexdigest()
        kind = {"schema": "gossamer.step_model", "version": FORMAT_VERSION}
        content = kind | {name: getattr(self, name) for name in _KEPT}
        return json.dumps(content | {"sha256": digests, "variables": [asdict(v) for v in self.variables]}, indent=1)

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the card, and so of both functions, hexadecimal."""
        return _digest(self.card)

    @property
    def _functions(self) -> dict[str, ca.Function]:
        return {"init": self.init, "step": self.step}

    def save(self, folder: Path) -> None:
        """Write ``model.json``, ``init.casadi`` and ``step.casadi`` into an existing folder."""
        (folder / "model.json").write_text(self.card, encoding="utf-8")
        for name, function in self._functions.items():
            (folder / f"{name}.casadi").write_text(function.serialize(), encoding="utf-8")

    @classmethod
    def load(cls, folder: Path) -> StepModel:
        """Read what ``save`` wrote.

        Raises
        ------
        ArtifactError
            A file is missing, truncated or changed, or of another schema or version.
        """
        try:
            card = json.loads((folder / "model.json").read_text(encoding="utf-8"))
            if (card["schema"], card["version"]) != ("gossamer.step_model", FORMAT_VERSION):
                msg = (
                    f"{folder / 'model.json'}: schema {card['schema']!r} version {card['version']!r}, this program reads "
                    f"'gossamer.step_model' version {FORMAT_VERSION}. Rebuild it with this version of Gossamer."
                )
                raise ArtifactError(msg)
            texts = {name: (folder / f"{name}.casadi").read_text(encoding="utf-8") for name in ("init", "step")}
            for name, text in texts.items():
                if _digest(text) != card["sha256"][name]:
                    msg = f"{folder / name}.casadi is damaged: its SHA-256 is not the one in model.json. Build it again."
                    raise ArtifactError(msg)
            init, step = (ca.Function.deserialize(text) for text in texts.values())
            variables = tuple(Variable(**v) for v in card["variables"])
            return cls(variables=variables, init=init, step=step, **{name: card[name] for name in _KEPT})
        except ArtifactError:
            raise
        except (OSError, ValueError, KeyError, TypeError, AttributeError, RuntimeError) as error:
            msg = f"cannot read the step model in {folder}: {error!r}. Build it again."
            raise ArtifactError(msg) from error


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
