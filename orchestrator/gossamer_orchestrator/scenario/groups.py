"""Check the groups of a scenario: components that are iterated until what they send each other agrees."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from ..fmi.file import FmuFile
from ..names import suggest
from .schema import Connection, Scenario
from .source import Problems


def check_groups(
    scenario: Scenario, files: Mapping[str, FmuFile], connections: Iterable[Connection], problems: Problems
) -> None:
    """Report groups that cannot be iterated.

    Parameters
    ----------
    scenario : Scenario
        The groups, and the master.
    files : mapping of str to FmuFile
        FMUs by component.
    connections : iterable of Connection
        Those that are right.
    problems : Problems
        Receives the mistakes.
    """
    if scenario.groups and scenario.master == "jacobi":
        text = 'a group is stepped one component after another, which master = "jacobi" is not. Remove one of the two.'
        problems.add(("groups",), text)
    homes: dict[str, int] = {}
    for i, group in enumerate(scenario.groups):
        place = ("groups", i, "components")
        for name in group.components:
            if name not in files:
                problems.add(place, f"there is no component {name!r}. {suggest(name, files)}")
                continue
            if name in homes:
                where = "twice in this group" if homes[name] == i else "in another group, too"
                problems.add(place, f"component {name!r} stands {where}. Name it once.")
                continue
            homes[name] = i
            if not files[name].interface.canGetAndSetFMUstate:
                text = f"FMU {files[name].name!r} of component {name!r} cannot restore its state (canGetAndSetFMUstate)"
                problems.add(place, f"{text}, so its step cannot be repeated. Remove it from the group.")
        names = set(group.components)
        if names <= set(files) and not any({c.sender, c.receiver} <= names for c in connections):
            problems.add(place, "the group's components are not connected to each other. Remove the group.")
