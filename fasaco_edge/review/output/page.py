"""A review as an HTML page: one file, no script, nothing from the network; light and dark.

It is built of elements, which escape all text that is put into them (``text.Html``).
"""

from __future__ import annotations

import base64
import io
from collections.abc import Iterable, Sequence
from pathlib import Path

from PIL import Image

from fasaco_edge.drawing.chart import COLOURS, Panel
from fasaco_edge.judge.floor import share_words
from fasaco_edge.review.comparison import (
    compared_rows,
    reason_counts,
    setup_differences,
    setup_words,
)
from fasaco_edge.review.document import ReviewDocument
from fasaco_edge.review.figures import document_of
from fasaco_edge.review.output import rows
from fasaco_edge.review.output.panels import (
    branching_panel,
    coverage_panel,
    replan_panel,
    saved_panel,
    state_panel,
)
from fasaco_edge.review.output.pictures import draw_fields, draw_map
from fasaco_edge.review.output.svg import svg_of
from fasaco_edge.review.review import Review
from fasaco_edge.review.spot import spots_left
from fasaco_edge.review.wording import amount, clock
from fasaco_edge.text import Html, element, html

MAP_ROOM = (1000, 700)
KINDS = {True: "good", False: "bad", None: "open"}
# Content security policy: only embedded pictures and its own style.
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
INTRODUCTION = (
    "A robot was to cover every place it can reach, on a map that grows while it drives. "
    "The floor is divided into square cells as wide as its tool; a cell is covered when the "
    "tool has passed over its centre. Cells do not include all of the floor: strips along walls "
    "belong to none; what the tool swept is given in square metres. When the map shows something "
    "new, the path is planned again: a replan."
)
GLOSSARY = {
    "reachable floor": "all that the tool touches wherever the robot can be, on the pixels of the "
    "last map; swept is the part of it that the tool passed over",
    "floor swept by the ledger": "what the daemon counted as swept at the end, reachable or not",
    "patch left": "reachable floor in one piece that was not swept; 4 dm2 are 20 x 20 cm",
    "covered again": "cells that were passed over more than once",
    "out of reach": "cells where the robot would fit, but that it cannot get to",
    "steps": "moves from one cell to the next",
    "revisits": "visits of cells beyond the first of each",
    "replan": "a new plan; its time is that of planning only",
    "map: cells more, fewer": "a new map showed more or less ground to cover than the one before",
    "gap": "time of a plan (steps and turns) above a lower bound for every plan, as a share of it",
    "changed on the map": "the rectangle in which cells or their neighbours changed",
    "plans that became no path": "they equalled the current path, or the map had outdated them",
    "better further on": "spare time was used to improve the rest of the path",
    "p99": "99 of 100 replans took at most this long",
    "degraded": "poses or maps had stopped, a pose jumped, or the robot stood on its path",
    "blocked": "the robot could not continue",
    "refused": "malformed or implausible messages; each is ignored",
}


def page_of(review: Review, other: Review | None = None) -> str:
    """Return an HTML document about a review, or about two side by side."""
    reviews = [review] if other is None else [review, other]
    documents = [document_of(each) for each in reviews]
    title = " against ".join(each.recording for each in documents)
    kind = "Review of a recorded mission" if other is None else "Two recorded missions compared"
    body = html(
        element(
            "header",
            element("p", kind, class_="kind"),
            element("h1", title),
            *(_verdict(each, index, len(documents)) for index, each in enumerate(documents)),
            element("p", INTRODUCTION, class_="lead"),
        ),
        _tiles(documents[0]) if other is None else _setup(*documents),
        _maps(reviews, documents),
        *(
            _fields(each, len(documents), figures.recording)
            for each, figures in zip(reviews, documents, strict=True)
        ),
        *(
            _orders(each, figures, len(documents))
            for each, figures in zip(reviews, documents, strict=True)
        ),
        _section("Over time", *_charts(reviews, documents)),
        _section("Figures", _figures(documents)),
        _section("Replans", *_reasons(reviews, documents)),
        *(
            _remarkable(each, figures, len(documents))
            for each, figures in zip(reviews, documents, strict=True)
        ),
        _section("Glossary", _table(("", ""), GLOSSARY.items(), "plain")),
        element(
            "footer",
            "Written by ",
            element("code", "fasaco-edge review"),
            ". All times count from the beginning of the recording.",
        ),
    )
    style = Path(__file__).with_name("page.css").read_text(encoding="utf-8")
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n'
        f"{element('title', title)}\n<style>\n{style}</style></head>\n"
        f"<body>{element('main', body)}</body></html>\n"
    )


def _verdict(figures: ReviewDocument, index: int, of: int) -> Html:
    """Return a verdict for each order of a run."""
    who = (_mark(index), f"{figures.recording}: ") if of > 1 else ()
    found = rows.verdicts(figures)
    return html(
        *(element("p", *who, text, class_=f"verdict {KINDS[complete]}") for complete, text in found)
    )


def _setup(one: ReviewDocument, other: ReviewDocument) -> Html:
    """Return the differences between the setups of two runs."""
    found = setup_differences(one, other)
    table = (_table(("", one.recording, other.recording), found),) if found else ()
    return _section("Do they compare?", element("p", setup_words(one, other)), *table)


def _mark(index: int) -> Html:
    """Return a dot in the colour of a run's curves."""
    red, green, blue = COLOURS[index]
    return element("i", class_="dot", style=f"background:rgb({red},{green},{blue})")


def _tiles(figures: ReviewDocument) -> Html:
    swept_m2, reachable_m2 = figures.swept_m2, figures.reachable_m2
    swept = share_words(swept_m2 / reachable_m2) if swept_m2 and reachable_m2 else "-"
    tiles = (
        (swept, "of the reachable floor swept"),
        (figures.share_covered or "-", "of the reachable cells covered"),
        (clock(figures.duration_s), "recorded"),
        (amount(figures.driven_m, "m"), "driven"),
        (amount(figures.revisits, ""), "revisits"),
        (amount(figures.replan_ms_p50, "ms"), "a replan, median"),
        (amount(figures.replan_ms_max, "ms"), "the slowest replan"),
        (amount(figures.faults, ""), "messages refused"),
    )
    cells = (element("div", element("b", v), element("span", n)) for v, n in tiles)
    return element("div", *cells, class_="tiles")


def _maps(reviews: Sequence[Review], documents: Sequence[ReviewDocument]) -> Html:
    maps = []
    for review, figures in zip(reviews, documents, strict=True):
        picture = draw_map(review, MAP_ROOM)
        shown = element("p", review.no_lattice or "no pose was recorded")
        if picture is not None:
            text = "map, covered cells, floor not swept, and the robot's track"
            shown = _image(picture, text)
        maps.append(element("figure", shown, _table(("", ""), rows.card_rows(figures), "plain")))
    kind = "maps two" if len(maps) > 1 else "maps"
    return _section("Final map", element("div", *maps, class_=kind))


def _image(picture: Image.Image, text: str) -> Html:
    buffer = io.BytesIO()
    picture.save(buffer, "PNG", optimize=True)
    content = base64.b64encode(buffer.getvalue()).decode()
    return Html(f'<img alt="{text}" src="data:image/png;base64,{content}">')


def _fields(review: Review, of: int, name: str) -> Html:
    """Return the pheromone field at four moments; nothing where none was drawn."""
    pictures = draw_fields(review)
    if not pictures:
        return Html()
    words = (
        "Bright is where the robot is going to drive: each published path strengthens the steps "
        "it takes. Driven steps are half as strong; what no path crosses, or the map has just "
        "shown, is dark."
    )
    figures = (
        element("figure", _image(picture, "pheromone field"), element("figcaption", clock(at_s)))
        for at_s, picture in pictures
    )
    title = "The pheromone trail" + (f" in {name}" if of > 1 else "")
    return _section(title, element("p", words), element("div", *figures, class_="fields"))


def _orders(review: Review, figures: ReviewDocument, of: int) -> Html:
    """Return a section of each order, the commands, and the floor left with reasons."""
    parts = [_table(rows.ORDERS, rows.order_rows(figures), "notes")]
    for title, names, cells in (
        ("Commands", rows.COMMANDS, rows.command_rows(figures)),
        ("Not reached", rows.UNREACHED, rows.unreached_rows(figures)),
        ("Reachable floor left", rows.LEFT, rows.left_rows(figures, spots_left(review))),
    ):
        if cells:
            parts += [element("h3", title), _table(names, cells, "notes")]
    return _section("Orders" + (f" of {figures.recording}" if of > 1 else ""), *parts)


def _charts(reviews: Sequence[Review], documents: Sequence[ReviewDocument]) -> list[Html]:
    labels = [each.recording for each in documents]
    key = Html()
    if len(reviews) > 1:
        marks = (html(_mark(index), label) for index, label in enumerate(labels))
        key = element("p", Html(" &nbsp; ".join(marks)), class_="key")
    charts = [
        _chart(coverage_panel(reviews, labels), 300),
        _chart(replan_panel(reviews, labels), 260),
    ]
    for review, label in zip(reviews, labels, strict=True):
        panel = state_panel(review)
        name = f" ({label})" if len(reviews) > 1 else ""
        charts.append(_chart(panel, 66 + 30 * len(panel.y.ticks), name))
        found = branching_panel(review), saved_panel(review)
        charts += [_chart(panel, 240, name) for panel in found if panel is not None]
    return [key, element("div", *charts, class_="charts")]


def _chart(panel: Panel, height: int, name: str = "") -> Html:
    caption = (element("p", panel.caption),) if panel.caption else ()
    title = element("h3", panel.title + name)
    return element("figure", title, *caption, svg_of(panel, height), class_="chart")


def _figures(documents: Sequence[ReviewDocument]) -> Html:
    if len(documents) == 1:
        return _table(("", ""), rows.figure_rows(documents[0]))
    names = (each.recording for each in documents)
    return _table(("", *names, "first less second"), compared_rows(*documents))


def _reasons(reviews: Sequence[Review], documents: Sequence[ReviewDocument]) -> list[Html]:
    counts = reason_counts(documents)
    if not counts:
        return [element("p", "There were none.")]
    if len(documents) == 1:
        return [
            _table(("reason", *rows.REASONS[1:]), rows.reason_rows(documents[0])),
            element("p", "The slowest:"),
            _table(rows.REPLANS, rows.replan_rows(reviews[0]), "notes"),
            element(
                "details",
                element("summary", "All of them, in order of time"),
                _table(rows.REPLANS, rows.replans_in_time(reviews[0]), "notes"),
            ),
        ]
    names = (each.recording for each in documents)
    return [_table(("reason", *names), [(kind, *map(str, n)) for kind, n in counts])]


def _remarkable(review: Review, figures: ReviewDocument, of: int) -> Html:
    """Return moments, troubles, faults and remarks of one run."""
    moments = rows.moment_rows(review)
    parts = [_table(("worst moments", "how much", "at", "context"), moments, "notes")]
    troubles, faults = rows.trouble_rows(review.troubles), rows.fault_rows(figures)
    none = "The mission was never in trouble, blocked or silent; the recorder could always write."
    titles = ("trouble", "at", "for", "why")
    parts.append(_table(titles, troubles, "notes") if troubles else element("p", none))
    if charges := rows.charge_rows(figures):
        parts.append(_table(("charged at", *rows.CHARGES[1:]), charges, "notes"))
    none = "No message was refused."
    parts.append(_table(("refused messages", "how many"), faults) if faults else element("p", none))
    torn = [part for part in figures.files if part.torn_bytes]
    remarks = [
        *(f"{part.path}: torn, {part.torn_bytes} bytes lost" for part in torn),
        *figures.remarks,
        *rows.unknown_lines(figures),
    ]
    if remarks:
        parts.append(element("ul", *(element("li", remark) for remark in remarks)))
    name = f" in {figures.recording}" if of > 1 else ""
    return _section(f"What stands out{name}", *parts)


def _section(title: str, *parts: Html) -> Html:
    return element("section", element("h2", title), *parts)


def _table(names: Sequence[str], cells: Iterable[Sequence[str]], kind: str = "numbers") -> Html:
    """Return a table: of "numbers", "plain" of text, "notes" where the last column is text."""
    head = element("tr", *(element("th", name) for name in names))
    lines = (element("tr", *(element("td", cell) for cell in row)) for row in cells)
    parts = (*((element("thead", head),) if any(names) else ()), element("tbody", *lines))
    return element("div", element("table", *parts, class_=kind), class_="wide")
