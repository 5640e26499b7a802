"""Order state: an order and its progress, changed by commands and other maps.

It is kept with the ledger. Nothing here needs a map, so commands are accepted before there is one.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from fasaco_edge.errors import CommandError, OrderError
from fasaco_edge.host.documents import misfits
from fasaco_edge.mission.map.configured_places import NO_PLACES, PlacesNote
from fasaco_edge.mission.map.placing import are_same
from fasaco_edge.mission.orders.keep_outs import (
    MOST_KEEP_OUT,
    KeepOutDocument,
    added,
    keep_out_document,
    keep_out_of,
    removed,
)
from fasaco_edge.mission.orders.order import (
    EVERYTHING_ONCE,
    Command,
    Errand,
    MissionOrder,
    OrderDocument,
    Zone,
    order_document,
    order_of,
)
from fasaco_edge.mission.work.order_progress import OrderProgress, Stage
from fasaco_edge.mission.work.reached_cells import ReachedCells

__all__ = ["AT_HOME", "NO_ORDER", "OrderState", "Stage"]

# Reason for being idle without autostart.
NO_ORDER = "no order yet: start a mission"
AT_HOME = "at home"
_START_AGAIN = "start the mission again; nothing is driven without an order"


@dataclass(frozen=True, slots=True)
class OrderState(OrderProgress):
    """An order and its progress, with the changes by commands and other maps."""

    @classmethod
    def autostart(cls) -> OrderState:
        """Return the order of a daemon with autostart: cover everything not covered yet."""
        return cls(MissionOrder(keep_covered=True), automatic=True)

    @classmethod
    def idle(cls, why: str) -> OrderState:
        """Return the state of a mission without an order."""
        return cls(why=why)

    @property
    def why_paused(self) -> str:
        """Why a paused robot stands still."""
        at_home = "at home, " if self.order is not None and self.why == AT_HOME else ""
        return at_home + "paused by command"

    def arrived(self) -> OrderState:
        """Return the state of a robot that has come home by command, and stays there."""
        return replace(self, errand="", paused=self.is_open, why=AT_HOME)

    def commanded(self, command: Command, *, has_home: bool = False) -> OrderState:
        """Return the state after a command.

        A repeated command changes nothing. ``start`` replaces another order; the same order
        continues unless it is over. ``has_home``: whether the configuration has a home.

        Raises:
            CommandError: there is nothing to pause, resume or plan, or no home.
            OrderError: a keep-out cannot be added, or no keep-out has the name.
        """
        match command.name:
            case "start":
                return self._started(command.order)
            case "pause" | "resume":
                return self._interrupted(is_paused=command.name == "pause")
            case "home":
                if not has_home and self.home is None:
                    raise CommandError(
                        "there is no home yet",
                        hint="set mission.home of the configuration; without it home is where an "
                        "order began",
                    )
                why = self.why if self.order is None else ""
                return replace(self, errand="home", paused=False, why=why)
            case "replan":
                if self.errand:
                    to = "home" if self.errand == "home" else "to charge"
                    hint = "resume or start the mission first"
                    raise CommandError(f"nothing to plan: the robot has gone {to}", hint=hint)
                if self.order is None or self.paused:
                    why = "the mission is paused" if self.paused else "there is no mission"
                    hint = f"{'resume' if self.paused else 'start'} the mission first"
                    raise CommandError(f"nothing to plan: {why}", hint=hint)
            case "cancel" | "reset":
                return self._dropped(is_reset=command.name == "reset")
            case "keep_out_add" | "keep_out_remove":
                assert command.keep_out is not None
                is_new = command.name == "keep_out_add"
                change = added if is_new else removed
                return replace(self, keep_out=change(self.keep_out, command.keep_out))
        return self

    def forgets(self, command: Command, after: OrderState) -> tuple[Zone, ...]:
        """Return the zones of an unfinished order that lose their coverage by a command."""
        if command.name == "reset":
            return EVERYTHING_ONCE.zones
        order = after.order
        if order is None or order is self.order or order.keep_covered or self.stage is Stage.OVER:
            return ()
        return order.zones

    def in_other_building(self, why: str) -> OrderState:
        """Return the state in another building, where zones, keep-outs and home are invalid."""
        if self.automatic:
            # A robot that was sent home must not start to sweep in the new building.
            is_to_stand = self.paused or self.errand == "home"
            return replace(OrderState.autostart(), paused=is_to_stand)
        if self.order is not None:
            return OrderState.idle(f"{why}: the order was dropped")
        # The errand led to a place in the previous building.
        is_paused = self.paused and not self.errand
        here = replace(self, home=None, errand="", paused=is_paused)
        return replace(here, frame="", keep_out=(), last=None)

    def in_other_frame(self, why: str) -> OrderState:
        """Return the state in another frame, before anything was covered.

        An order for everything stays valid there; zones and keep-outs do not.
        """
        has_places = self.order is not None and (
            bool(self.order.keep_out or self.keep_out)
            or any(zone.polygon for zone in self.order.zones)
        )
        if self.order is None or self.automatic or has_places:
            return self.in_other_building(why)
        is_to_stand = self.paused or self.errand == "home"
        return OrderState(self.order, paused=is_to_stand, spent_s=self.spent_s)

    def _interrupted(self, *, is_paused: bool) -> OrderState:
        """Return the state after ``pause`` or ``resume``: interrupted work continues later."""
        if not (self.is_open or self.errand):
            name = "pause" if is_paused else "resume"
            raise CommandError(f"there is no mission to {name}")
        why = self.why if is_paused or self.order is None else ""
        return replace(self, paused=is_paused, why=why)

    def _dropped(self, *, is_reset: bool) -> OrderState:
        """Return the state after ``cancel`` or ``reset``; a reset forgets home, too."""
        if is_reset:
            idle = OrderState.idle("reset: what was covered is forgotten")
            return replace(idle, keep_out=self.keep_out)
        if self.order is None and not self.errand:
            return self
        return self._without_order("cancelled")

    def _started(self, order: MissionOrder) -> OrderState:
        same = self.order is not None and are_same(self.order, order)
        errand: Errand = "" if self.errand == "home" else self.errand
        if same and self.stage is not Stage.OVER:
            return replace(self, paused=False, errand=errand, why="")
        return replace(self._without_order(""), order=order, errand=errand, last=None)

    def _without_order(self, why: str) -> OrderState:
        """Return the state without an order on the same map: home and keep-outs stay."""
        here = OrderState(why=why, home=self.home, keep_out=self.keep_out)
        last = self.last if self.order is None or self.automatic else self.order
        return replace(here, frame=self.frame, places=self.places, last=last)

    def to_json(self) -> str:
        """Return the state as JSON, for the ledger's file."""
        state = {each.name: getattr(self, each.name) for each in fields(self)}
        order, last = (order_document(each) if each else None for each in (self.order, self.last))
        keep_out = msgspec.convert(list(map(keep_out_document, self.keep_out)), _KeepOuts)
        note = _Note(**state | {"version": 1, "order": order, "last": last, "keep_out": keep_out})
        return msgspec.json.encode(note).decode()

    @classmethod
    def from_json(cls, note: str) -> OrderState:
        """Return the state encoded by ``to_json``.

        Raises:
            OrderError: the note has another version, or is invalid.
        """
        try:
            kept = msgspec.json.decode(note, type=_Note)
        except (msgspec.DecodeError, UnicodeError) as error:
            raise OrderError(
                f"the order kept with the ledger cannot be read: {error}", hint=_START_AGAIN
            ) from error
        for fault in misfits(kept, OrderError):
            raise fault
        order = None if kept.order is None else order_of(kept.order)
        last = None if kept.last is None else order_of(kept.last)
        if order is not None and not (
            kept.zone < len(order.zones) and kept.pass_number <= order.zones[kept.zone].passes
        ):
            raise OrderError(
                f"the order kept has no zone {kept.zone} with a pass {kept.pass_number}",
                hint=_START_AGAIN,
            )
        keep_out = tuple(map(keep_out_of, kept.keep_out))
        state = msgspec.structs.asdict(kept) | {"order": order, "last": last, "keep_out": keep_out}
        del state["version"]
        return cls(**state)


_KeepOuts = Annotated[list[KeepOutDocument], Meta(max_length=MOST_KEEP_OUT)]


class _Note(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True, kw_only=True
):
    """An order state as kept on disk, with the files' member names.

    Older daemons can read it only without errand, keep-outs, frame, places, reached cells, time
    limit and cancelled order.
    """

    version: Literal[1]
    order: OrderDocument | None
    automatic: bool = msgspec.field(name="standing")
    stage: Stage
    zone: Annotated[int, Meta(ge=0)]
    pass_number: Annotated[int, Meta(ge=1)] = msgspec.field(name="pass")
    begun: bool
    tries: int
    home: tuple[int, int] | None
    paused: bool
    why: str
    errand: Errand = ""
    frame: str = ""
    places: PlacesNote = NO_PLACES
    keep_out: _KeepOuts = []
    reached: ReachedCells | None = None
    spent_s: Annotated[float, Meta(ge=0)] = 0.0
    late: str = ""
    last: OrderDocument | None = None
