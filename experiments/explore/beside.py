"""The page to explore beside another page, which links into it with its own car and friction laws."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import urlencode

from steer_env.experiments.explore import parameters
from steer_env.experiments.explore.writing import explore
from steer_env.experiments.pages.pages import LIVE_FOLDER
from steer_env.friction import sites
from steer_env.friction.law import as_mapping, law_of, make
from steer_env.vehicle import chassis as chassis_models
from steer_env.vehicle.cars import Car


class PageBeside(NamedTuple):
    """A car with friction laws that a page links to."""

    car: Car
    laws: Mapping[str, Any]  # label in the page -> a law or sites, in a form of steer_env.friction.sites.resolve
    chassis: Sequence[str] = chassis_models.available()

    def write(self, folder: Path) -> list[tuple[str, str]]:
        """Write the page into ``folder / LIVE_FOLDER``, and give label and address of each law.

        The address is empty where the page's fields would refuse the parameters of the law, or do not give them.
        Without a law that has an address there is no page.

        Raises
        ------
        ValueError
            As of :func:`steer_env.experiments.explore.explore`.
        """
        found = {label: address(self.car, law, self.chassis[0]) for label, law in self.laws.items()}
        names = dict.fromkeys(law_display_name(self.laws[label]) for label, values in found.items() if values)
        if names:
            explore(folder / LIVE_FOLDER, vehicle=self.car, friction=list(names), chassis=self.chassis)
        return [(label, values and f"{LIVE_FOLDER}/index.html#{values}") for label, values in found.items()]


def law_display_name(law: Any) -> str:
    """What the page calls a law in a form of :func:`steer_env.friction.sites.resolve`, or sites, which are text."""
    p = sites.resolve(law)
    return sites.as_text(law) if isinstance(p, sites.Sites) else law_of(p).name


def address(car: Car, law: Any, chassis: str) -> str:
    """What the page's address holds behind # for a law or sites; empty where the page does not give its parameters."""
    p, name = sites.resolve(law), law_display_name(law)
    try:
        fields = {q.name: q for q in parameters.every(car, name, chassis)}
    except ValueError:  # it falls too steeply with the speed for sliders
        return ""
    if isinstance(p, sites.Sites):  # whose text has all that differs
        return urlencode({"law": name, "chassis": chassis})
    wanted = as_mapping(p)
    usual = parameters.of_law(name)
    own = {key: wanted[key] for key in usual if wanted.get(key, usual[key]) != usual[key]}
    inside = all(fields[f"friction.{key}"].low <= value <= fields[f"friction.{key}"].high for key, value in own.items())
    if not inside or as_mapping(make(name, **own)) != wanted:
        return ""
    return urlencode({"law": name, "chassis": chassis} | {f"friction.{key}": value for key, value in own.items()})
