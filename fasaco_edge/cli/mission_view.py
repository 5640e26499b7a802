"""How far a mission is, as tables for people."""

from __future__ import annotations

from typing import Any

from rich.table import Table

from fasaco_edge.cli.console.terminal import figures, out
from fasaco_edge.watch import phrases


def show(report: dict[str, Any]) -> None:
    """Print a daemon's answer."""
    mission = report["mission"]
    console = out()
    console.print(figures(_rows(report, mission)))
    if mission["zones"]:
        console.print(_zones(mission["zones"]))
    if mission["unreached"]["areas"]:
        console.print(_unreached(mission["unreached"]))


def _rows(report: dict[str, Any], mission: dict[str, Any]) -> list[tuple[str, str]]:
    rows = [(name, str(report[name])) for name in ("robot", "state", "reason")]
    if mission["ordered"] is not None:
        began = "begun by itself" if mission["ordered"] == "itself" else "as ordered"
        stage = phrases.stage(*(mission[name] for name in ("stage", "zone", "pass", "passes")))
        rows.append(("mission", f"{stage}, {began}"))
    if coverage := report["coverage"]:
        cells = coverage["covered"], coverage["coverable"]
        told = phrases.covered(coverage["fraction"], *cells, coverage["covered_m2"])
        rows.append(("covered", told))
    if mission["keep_out"]:
        rows.append(("keep-out zones", str(mission["keep_out"])))
    if mission["return_home"]:
        home = mission["home"]
        rows.append(("home", f"({home['x']:.2f}, {home['y']:.2f}) m" if home else "not known yet"))
    return rows


def _zones(zones: list[dict[str, Any]]) -> Table:
    table = Table("zone", "pass", "covered", title="Zones", title_justify="left")
    for zone in zones:
        counts = (zone[name] for name in ("pass", "passes", "covered", "cells"))
        table.add_row(str(zone["name"]), *phrases.zone_progress(*counts))
    return table


def _unreached(unreached: dict[str, Any]) -> Table:
    table = Table("cells", "m2", "at", "why", title="Not reached", title_justify="left")
    for area in unreached["areas"]:
        place = f"({area['x']:.2f}, {area['y']:.2f}) m"
        table.add_row(str(area["cells"]), f"{area['m2']:.2f}", place, str(area["reason"]))
    if unreached["areas_left_out"]:
        table.caption = f"and {unreached['areas_left_out']} smaller areas"
    return table
