"""Rows of text of a review for the terminal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from msgspec.structs import astuple

from fasaco_edge.client.phrases import scale_words
from fasaco_edge.judge.floor import swept_words
from fasaco_edge.recording.read.robot_clock import clock
from fasaco_edge.review.document import ReviewDocument
from fasaco_edge.review.figures import NOT_KNOWN, amount, count, figures, floor_words
from fasaco_edge.review.floor_and_rooms import MILESTONES, room_at
from fasaco_edge.review.orders import order_words, ordered_words
from fasaco_edge.review.spot import spots_left
from fasaco_edge.text import percent
from fasaco_edge.wire.documents.path_documents import Rectangle
from fasaco_edge.wire.reasons import plain

if TYPE_CHECKING:
    from fasaco_edge.review.review import Review
    from fasaco_edge.review.run_data import PathSample

# Keys of the settings shown; the run card and the JSON document have all.
CARD_SETTINGS = ("planner.name", "robot.tool_width_m", "robot.radius_m", "planner.seed")
MOST_PLACES, MOST_COMMANDS = 2, 6
# Least distance without poses [m], and least time in a state [s], that are shown.
LEAST_LOST_M, LEAST_STATE_S = 1.0, 0.1

Rows = Sequence[tuple[str, ...]]


def tables(review: Review, document: ReviewDocument) -> Iterator[tuple[str, tuple[str, ...], Rows]]:
    """Yield title, names of the columns, and rows of each table of a full review.

    A table without names of columns is a list of names and values.
    """
    orders = [
        (
            str(number),
            clock(order.at_s),
            clock(order.until_s),
            order.state or NOT_KNOWN,
            amount(order.driven_m, "m"),
            str(order.replans),
            clock(order.paused_s) if order.paused_s else "-",
            order_words(order.order) if order.order else "everything, or as ordered before",
        )
        for number, order in enumerate(document.orders, 1)
    ]
    columns: tuple[str, ...] = (
        "order",
        "from",
        "to",
        "result",
        "driven",
        "replans",
        "paused",
        "asked for",
    )
    yield "Orders", columns, orders
    columns = ("room", "m2", "time", "entered", "swept", "passes", "left")
    yield "Rooms", columns, _room_rows(document, review)
    yield "Commands", (), [(clock(each.at_s), each.command) for each in document.commands]
    unreached = [
        (str(number), f"{area.m2:.2f}", f"({area.x:.2f}, {area.y:.2f})", area.reason)
        for number, order in enumerate(document.orders, 1)
        for area in order.unreached
    ]
    yield "Not reached", ("order", "m2", "at", "why"), unreached
    left = [
        (f"{patch.m2:.2f}", f"({patch.x:.2f}, {patch.y:.2f})", f"{spot.why}: {spot.words}")
        for patch, spot in zip(document.left, spots_left(review), strict=True)
    ]
    yield "Floor left", ("m2", "at", "why"), left
    reasons = [(plain(kind), str(count)) for kind, count in document.replans_by_reason.items()]
    yield "Reasons of replans", ("reason", "replans"), reasons
    columns = ("at", "took", "steps planned", "gap", "to drive", "changed on the map", "why")
    yield "Replans", columns, [_replan_row(path) for path in review.replans.later]
    troubles = [
        (s.name, clock(s.begin_s), f"{s.seconds:.1f} s", plain(s.reason)) for s in review.troubles
    ]
    yield "Troubles", ("state", "at", "for", "reason"), troubles
    yield "Charges", ("at", "for", "battery"), charge_rows(document)
    refused = [(code, str(count)) for code, count in document.faults_by_code.items()]
    yield "Refused messages", ("code", "messages"), refused


def _room_rows(document: ReviewDocument, review: Review) -> list[tuple[str, ...]]:
    at = {patch: room_at(review.data, (patch.x, patch.y)) for patch in document.left}
    found: list[tuple[str, ...]] = []
    for room in document.rooms:
        patches = [
            f"{patch.m2:.2f} at ({patch.x:.2f}, {patch.y:.2f})"
            for patch, there in at.items()
            if there is not None and there.id == room.room
        ]
        left = NOT_KNOWN if room.left_m2 is None else f"{room.left_m2:.2f} m2"
        found.append(
            (
                room.title + (", left out" if room.skip else ""),
                f"{room.area_m2:.1f}",
                clock(room.seconds),
                str(room.entered),
                NOT_KNOWN if room.share is None else percent(room.share),
                "-" if room.passes is None else str(room.passes),
                left + (f": {_some(patches)}" if patches else ""),
            )
        )
    return found


def screen_rows(review: Review, document: ReviewDocument) -> list[tuple[str, str]]:
    """Return the most important rows; they fit on one screen, with verdict and curve."""
    by_name = {figure.name: figure.text for figure in figures(document)}
    config, grid = document.config, document.map
    sides = "" if grid is None else "{:.1f} x {:.1f} m, ".format(*grid.sides_m)
    planner = config.get("planner.name", "planner not recorded")
    after = {percent: by_name[f"{percent} % of cells covered after"] for percent in MILESTONES}
    reached = [f"{percent} % {at}" for percent, at in after.items() if at != "never"]
    replans = f"{document.replans}"
    for slowest in review.replans.slowest_first[:1]:
        replans += f", {amount(document.replan_ms_p50, 'ms')} in the median"
        replans += f", the slowest {amount(slowest.plan_ms, 'ms')} at {clock(slowest.at_s)}"
    left = [f"{patch.m2:.2f} m2 at ({patch.x:.2f}, {patch.y:.2f})" for patch in document.left]
    unreached = [
        f"{area.m2:.2f} m2 at ({area.x:.2f}, {area.y:.2f}) {area.reason}"
        for order in document.orders[-1:]
        for area in order.unreached
    ]
    troubles = [
        f"{clock(t.at_s)} for {t.seconds:.1f} s: {plain(t.reason) or t.state}"
        for t in document.troubles
    ]
    commands = [f"{clock(each.at_s)} {each.command}" for each in document.commands]
    charges = [f"{at} for {seconds}, {levels}" for at, seconds, levels in charge_rows(document)]
    has_count = document.covered_cells is not None
    whose = "its tool, or another robot's," if in_fleet(document) else "the tool"
    covered_how = f": {whose} passed their centres"
    found = [
        ("run", f"{_began(document.began)}, {sides}{planner}, {document.robot or 'robot'}"),
        *clock_rows(document),
        ("floor swept", _swept(review, document)),
        ("by others", _by_others(document)),
        ("covered", by_name["covered"] + covered_how * has_count),
        ("cells after", ", ".join(reached)),
        ("left", _some(left)),
        ("not reached", _some(unreached)),
        ("troubles", _some(troubles)),
        ("poses", _lost_way(review)),
        ("commands", _some(commands, MOST_COMMANDS)),
        ("rooms", _shares(document)),
        ("charges", _some(charges)),
        ("driven", amount(document.driven_m, "m")),
        ("time", _times(document)),
        ("stood", _stood(document)),
        ("replans", replans),
        (
            "refused",
            f"{document.faults} message{'s' * (document.faults != 1)}; "
            f"lost {count(document.recorder_lost, '')}",
        ),
        ("processor", _processor(document)),
    ]
    return [(name, text) for name, text in found if text]


def _shares(document: ReviewDocument) -> str:
    known = sorted((room.share, room.title) for room in document.rooms if room.share is not None)
    return ", ".join(f"{title} {percent(share)}" for share, title in known)


def _lost_way(review: Review) -> str:
    """Return number and length of the gaps between poses; "" if they are short."""
    data = review.data
    ways_m = data.lengths_m[~data.driven]
    if ways_m.sum() < LEAST_LOST_M:
        return ""
    gaps = f"{len(ways_m)} gap{'s' * (len(ways_m) != 1)}"
    return f"{gaps} over {ways_m.sum():.0f} m: floor swept in them does not count"


def _stood(document: ReviewDocument) -> str:
    if (stand := document.longest_stand) is None:
        return ""
    at = f"from {clock(stand.at_s)} at ({stand.x:.2f}, {stand.y:.2f})"
    why = ", ".join([*stand.states, *filter(None, [plain(stand.reason)])])
    return f"longest {stand.seconds:.1f} s {at}: {why}"


def _times(document: ReviewDocument) -> str:
    """Return the time in each state, the longest first; "" if there was one state only."""
    longest = sorted(document.states.items(), key=lambda each: -each[1])
    shown = [f"{name} {clock(seconds)}" for name, seconds in longest if seconds >= LEAST_STATE_S]
    return ", ".join(shown) if len(shown) > 1 else ""


def _processor(document: ReviewDocument) -> str:
    daemon, recorder = document.processor_s, document.recorder_processor_s
    if not daemon:
        return ""
    text = f"daemon {amount(daemon, 's')}"
    if document.recorded_s:
        text += f" ({100 * daemon / document.recorded_s:.1f} % of a core)"
    return text if recorder is None else f"{text}, recorder {amount(recorder, 's')}"


def _some(texts: Sequence[str], most: int = MOST_PLACES) -> str:
    more = f"; {len(texts) - most} more" if len(texts) > most else ""
    return "; ".join(texts[:most]) + more


def _swept(review: Review, document: ReviewDocument) -> str:
    text, by, share = floor_words(document), "recorded poses", "and"
    orders = document.orders
    counted = review.data.ledger_floor
    if not text and counted is not None and counted.reached_m2 is not None:
        # Without an order the daemon counts all floor, in its zones or not.
        text, orders = f"{counted.swept_m2:,.1f} m2", []
        if counted.reachable_m2:
            text = swept_words(counted.reached_m2, counted.reachable_m2)
            orders = document.orders[-1:]
        by, share = "the daemon's count", "of these"
    if not text:
        return NOT_KNOWN
    before_m2 = document.swept_before_m2
    # The daemon's count includes this floor, the recorded poses do not.
    before = f", {share} {before_m2:.1f} m2 before the recording" if before_m2 else ""
    return f"{text}{ordered_words(orders)}, by {by}{before}"


def _by_others(document: ReviewDocument) -> str:
    if not in_fleet(document):
        return ""
    if document.swept_by_others_m2 is None:
        return "not recorded: floor that other robots swept counts as left"
    return f"{document.swept_by_others_m2:.1f} m2 more swept by other robots of its fleet"


def in_fleet(document: ReviewDocument) -> bool:
    """Return whether the robot belongs to a fleet."""
    return bool(document.config.get("fleet.name"))


def card_rows(document: ReviewDocument) -> list[tuple[str, str]]:
    """Return version, settings and files of a run."""
    config, parts = document.config, document.files
    settings = [
        f"{name.rpartition('.')[2] if name != 'planner.name' else 'planner'} {config[name]}"
        for name in CARD_SETTINGS
        if name in config
    ]
    megabytes = sum(part.bytes for part in parts) / 1e6
    state = "" if document.is_ended else ", not ended in order"
    return [
        ("version", document.version or "not recorded"),
        ("settings", ", ".join(settings) or "not recorded"),
        ("recording", f"{len(parts)} part{'s' * (len(parts) != 1)}, {megabytes:.1f} MB{state}"),
    ]


def clock_rows(document: ReviewDocument) -> list[tuple[str, str]]:
    """Return the clock rate of a simulated robot; no row for a real one."""
    words = scale_words(document.time_scale)
    return [("clock", f"the robot's, {words}")] if words else []


def _replan_row(path: PathSample) -> tuple[str, ...]:
    about = path.about
    return (
        clock(path.at_s),
        amount(path.plan_ms, "ms"),
        str(about.steps if about.planned_steps is None else about.planned_steps),
        "-" if about.gap is None else f"{100 * about.gap:.1f} %",
        "-" if about.planned_cost_s is None else clock(about.planned_cost_s),
        _place(about.changed),
        plain(about.reason),
    )


def charge_rows(document: ReviewDocument) -> list[tuple[str, str, str]]:
    """Return each period of charging: beginning, duration, battery levels before and after."""
    return [
        (
            clock(charge.at_s),
            clock(charge.seconds),
            " to ".join(
                NOT_KNOWN if level is None else percent(level, 0)
                for level in (charge.level_from, charge.level_to)
            ),
        )
        for charge in document.charges
    ]


def unknown_lines(document: ReviewDocument) -> Iterator[str]:
    """Yield a line for each kind of samples or figures missing in a recording, with the reason."""
    for topic, number in document.unreadable.items():
        yield f"{number} samples of {topic} cannot be read"
    for names, why in document.not_recorded.items():
        yield f"not known: {names}: {why}"


def _place(changed: Rectangle | None) -> str:
    if changed is None:
        return "-"
    x0, y0, x1, y1 = astuple(changed)
    return f"{x1 - x0:.1f} x {y1 - y0:.1f} m at ({(x0 + x1) / 2:.1f}, {(y0 + y1) / 2:.1f})"


def _began(began: str) -> str:
    """Return the time of the beginning; a year before 2024 means that the clock was not set."""
    when = began.replace("T", " ").replace("Z", " UTC")
    return when if began >= "2024" else f"{when}, by a clock that was not set"
