"""Read ``campaign.toml``: keys and types are those of ``gossamer_models.campaign.Campaign``, mistakes have lines."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields, replace
from pathlib import Path

from gossamer_models.campaign import Campaign, Chain, Damage, Distribution, Mesh, Noise, Vary
from gossamer_models.mistakes import DescriptionError
from pydantic import ValidationError

from ..names import suggest
from ..scenario.schema import Table
from ..scenario.source import Location, Problems, Source
from ..scenario.toml_file import explain, parse_toml, read_text

_TABLES: dict[str | int, type] = {
    "membrane": Mesh,
    "damage": Damage,
    "vary": Vary,
    "noise": Noise,
    "strain": Distribution,
    "resistance": Distribution,
    "chain": Chain,
}


class _File(Table):
    campaign: Campaign


def load_campaign(path: Path) -> tuple[Campaign, Source]:
    """Read and check a campaign file.

    Parameters
    ----------
    path : Path
        A TOML file.

    Returns
    -------
    Campaign
        The file of an artifact is relative to the campaign's folder.
    Source
        The text.

    Raises
    ------
    ScenarioError
        The file cannot be read, is not TOML, or has unknown, missing or meaningless keys; one line per mistake.
    """
    source = Source(path.name, read_text(path, "campaign"))
    content = parse_toml(source.text, source.name, "campaign")
    problems = Problems(source)
    try:  # as JSON, so that arrays are pairs and tables are what they are for, while types stay strict
        campaign = _File.model_validate_json(json.dumps({"campaign": content}, default=str)).campaign
    except ValidationError as error:
        for item in error.errors():
            place = item["loc"][1:]
            cause = item.get("ctx", {}).get("error")
            if isinstance(cause, DescriptionError):
                _note(cause, problems, place)
            elif item["type"] == "too_long" or (item["type"] == "missing" and isinstance(place[-1], int)):
                pair = place if item["type"] == "too_long" else place[:-1]
                problems.add(pair, f"{pair[-1]!r} needs two numbers, [low, high].")
            else:
                problems.add(place, explain(item["type"], place, item["msg"], item["input"], _known(place)))
        problems.raise_if_any()
        raise
    if campaign.chain is not None and campaign.chain.artifact is not None:
        artifact = str((path.parent / campaign.chain.artifact).resolve())
        campaign = replace(campaign, chain=replace(campaign.chain, artifact=artifact))
    return campaign, source


@contextmanager
def locating(source: Source) -> Iterator[None]:
    """Give the mistakes of a campaign that show inside the ``with`` block the lines of its file."""
    try:
        yield
    except DescriptionError as error:
        problems = Problems(source)
        _note(error, problems)
        problems.raise_if_any()


def _note(error: DescriptionError, problems: Problems, place: Location = ()) -> None:
    for mistake in error.mistakes:
        advice = f" {suggest(mistake.name, mistake.known)}" if mistake.known else ""
        problems.add((*place, *mistake.place), mistake.text + advice)


def _known(location: Location) -> list[str]:
    """List the keys of the table around a location."""
    owner = next((_TABLES[part] for part in reversed(location[:-1]) if part in _TABLES), Campaign)
    return [field.name for field in fields(owner)]
