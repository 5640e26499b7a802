"""A review as a page: one file, no script, nothing from the net; light and dark.

It is built of elements, in which all that is not mark-up of ours is escaped (``text.html``).
"""

from __future__ import annotations

import base64
import io
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from fasaco_edge.drawing.chart import COLOURS, Panel
from fasaco_edge.review.charts import coverage_panel, replan_panel, state_panel
from fasaco_edge.review.document import document, troubles
from fasaco_edge.review.picture import draw_map
from fasaco_edge.review.review import Review
from fasaco_edge.review.rows import (
    MOST_REPLANS,
    REASONS,
    REPLANS,
    amount,
    card_rows,
    clock,
    compared_rows,
    figure_rows,
    reason_rows,
    replan_rows,
    setup_words,
    verdicts,
)
from fasaco_edge.review.setups import setup_differences
from fasaco_edge.review.svg import STYLE, svg_of
from fasaco_edge.text import Html, element, html

MAP_ROOM = (1000, 700)
KINDS = {True: "good", False: "bad", None: "open"}
# What a browser may do with it: show pictures that are in it, and its own style.
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
INTRODUCTION = (
    "A robot was to pass over every place it can reach, on a map that grows while it drives. "
    "The ground is divided into square cells as wide as its tool; a cell is covered when the "
    "tool has passed over its centre. Whenever the map shows something new, the way is planned "
    "anew: a replan."
)
GLOSSARY = {
    "covered again": "cells that were passed over more than once",
    "out of reach": "cells where the robot would fit, but that it cannot come to",
    "steps": "moves from one cell to the next",
    "revisits": "visits of cells beyond the first of each",
    "replan": "a plan made anew; its time is that of planning alone",
    "map: cells more, fewer": "a new map showed more or less ground to cover than the one before",
    "gap": "steps of a plan above those that no plan can do without; where turns cost, more steps "
    "may be the better way",
    "changed on the map": "the rectangle in which cells came, went or have other neighbours",
    "plans that became no path": "they found the path there was, or the map had changed meanwhile",
    "better further on": "spare time was used to find a better rest of the way",
    "p99": "of a hundred replans, 99 were not slower",
    "degraded": "poses or maps had stopped, or a pose jumped; the robot went on",
    "blocked": "the robot could not go on",
    "refused": "messages that were broken or made no sense; each is ignored",
}


def page_of(review: Review, other: Review | None = None) -> str:
    """Return an HTML document about a review, or about two side by side."""
    reviews = [review] if other is None else [review, other]
    told = [document(each) for each in reviews]
    title = " against ".join(document["recording"] for document in told)
    kind = "Review of a recorded mission" if other is None else "Two recorded missions compared"
    body = html(
        element(
            "header",
            element("p", kind, class_="kind"),
            element("h1", title),
            *(_verdict(document, index, len(told)) for index, document in enumerate(told)),
            element("p", INTRODUCTION, class_="lead"),
        ),
        *(_tiles(told[0]) if other is None else (_setup(told),)),
        _maps(reviews, told),
        _section("Over time", *_charts(reviews, told)),
        _section("Figures", *_figures(told)),
        _section("Replans", *_reasons(reviews, told)),
        *(
            _stories(each, document, len(told))
            for each, document in zip(reviews, told, strict=True)
        ),
        _section("What the words mean", _table(("", ""), GLOSSARY.items(), "plain")),
        element(
            "footer",
            "Written by ",
            element("code", "fasaco-edge review"),
            ". All times count from the beginning of the recording.",
        ),
    )
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n'
        f"{element('title', title)}\n<style>{STYLE}</style></head>\n"
        f"<body>{element('main', body)}</body></html>\n"
    )


def _verdict(told: Mapping[str, Any], index: int, of: int) -> Html:
    """Return a verdict for each order of a run."""
    who = (_mark(index), f"{told['recording']}: ") if of > 1 else ()
    found = verdicts(told)
    return html(
        *(element("p", *who, text, class_=f"verdict {KINDS[complete]}") for complete, text in found)
    )


def _setup(told: Sequence[Mapping[str, Any]]) -> Html:
    """Return what two runs were not set up alike with."""
    one, other = told
    rows = setup_differences(one, other)
    names = ("", one["recording"], other["recording"])
    table = (_table(names, rows),) if rows else ()
    return _section("Do they compare?", element("p", setup_words(one, other)), *table)


def _mark(index: int) -> Html:
    """Return a dot in the colour of a run's curves."""
    red, green, blue = COLOURS[index]
    return element("i", class_="dot", style=f"background:rgb({red},{green},{blue})")


def _tiles(told: Mapping[str, Any]) -> list[Html]:
    covered, coverable = told["covered_cells"], told["coverable_cells"]
    share = f"{100 * covered / coverable:.1f} %" if covered is not None and coverable else "-"
    tiles = [
        (share, "of the reachable cells covered"),
        (clock(told["duration_s"]), "recorded"),
        (amount(told["driven_m"], "m"), "driven"),
        (amount(told["revisits"], ""), "revisits"),
        (amount(told["replan_ms_p50"], "ms"), "a replan, median"),
        (amount(told["replan_ms_max"], "ms"), "the slowest replan"),
        (amount(told["faults"], ""), "messages refused"),
    ]
    cells = (element("div", element("b", v), element("span", n)) for v, n in tiles)
    return [element("div", *cells, class_="tiles")]


def _maps(reviews: Sequence[Review], told: Sequence[Mapping[str, Any]]) -> Html:
    figures = []
    for review, its_figures in zip(reviews, told, strict=True):
        picture = draw_map(review, MAP_ROOM)
        card = _table(("", ""), card_rows(its_figures), "plain")
        if picture is None:
            figures.append(element("figure", element("p", "no map was recorded"), card))
            continue
        buffer = io.BytesIO()
        picture.save(buffer, "PNG", optimize=True)
        content = base64.b64encode(buffer.getvalue()).decode()
        text = "map, covered cells and the way of the robot"
        image = Html(f'<img alt="{text}" src="data:image/png;base64,{content}">')
        figures.append(element("figure", image, card))
    kind = "maps two" if len(figures) > 1 else "maps"
    return _section("The map in the end", element("div", *figures, class_=kind))


def _charts(reviews: Sequence[Review], told: Sequence[Mapping[str, Any]]) -> list[Html]:
    labels = [document["recording"] for document in told]
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
    return [key, element("div", *charts, class_="charts")]


def _chart(panel: Panel, height: int, name: str = "") -> Html:
    caption = (element("p", panel.caption),) if panel.caption else ()
    title = element("h3", panel.title + name)
    return element("figure", title, *caption, svg_of(panel, height), class_="chart")


def _figures(told: Sequence[Mapping[str, Any]]) -> list[Html]:
    if len(told) == 1:
        return [_table(("", ""), figure_rows(told[0]))]
    names = tuple(document["recording"] for document in told)
    return [_table(("", *names, "first less second"), compared_rows(told[0], told[1]))]


def _reasons(reviews: Sequence[Review], told: Sequence[Mapping[str, Any]]) -> list[Html]:
    counts = [document["replans_by_reason"] for document in told]
    kinds = dict.fromkeys(kind for count in counts for kind in count)
    if not kinds:
        return [element("p", "There were none.")]
    if len(told) == 1:
        slowest = replan_rows(reviews[0].replans.slowest_first(MOST_REPLANS))
        return [
            _table(("why it came", *REASONS[1:]), reason_rows(told[0])),
            element("p", "The slowest ones:"),
            _table(REPLANS, slowest, "told"),
        ]
    names = tuple(document["recording"] for document in told)
    rows = [(kind, *(str(count.get(kind, 0)) for count in counts)) for kind in kinds]
    return [_table(("why it came", *names), rows)]


def _stories(review: Review, told: Mapping[str, Any], of: int) -> Html:
    """Return what stands out in one run."""
    moments = [(m.what, amount(m.value, m.unit), clock(m.at_s), m.note) for m in review.moments]
    found = [(s.name, clock(s.begin_s), f"{s.seconds:.1f} s", s.reason) for s in troubles(review)]
    faults = [(code, str(count)) for code, count in told["faults_by_code"].items()]
    remarks = [
        *(
            f"{p['path']}: torn, {p['torn_bytes']} bytes lost"
            for p in told["files"]
            if p["torn_bytes"]
        ),
        *told["remarks"],
        *(
            f"{count} samples of {topic} cannot be read"
            for topic, count in told["unreadable"].items()
        ),
        *(f"not known: {names}: {why}" for names, why in told["not_recorded"].items()),
    ]
    parts = [_table(("worst moments", "how much", "at", "what else is known"), moments, "told")]
    none = "It was never degraded, blocked or silent, and the recorder could always write."
    titles = ("trouble", "at", "for", "why")
    parts.append(_table(titles, found, "told") if found else element("p", none))
    none = "No message was refused."
    parts.append(_table(("refused messages", "how many"), faults) if faults else element("p", none))
    if remarks:
        parts.append(element("ul", *(element("li", remark) for remark in remarks)))
    name = f" in {told['recording']}" if of > 1 else ""
    return _section(f"What stands out{name}", *parts)


def _section(title: str, *parts: Html) -> Html:
    return element("section", element("h2", title), *parts)


def _table(names: Sequence[str], rows: Iterable[Sequence[str]], kind: str = "numbers") -> Html:
    """Return a table: of "numbers", "plain" of text, "told" where the last column is text."""
    head = element("tr", *(element("th", name) for name in names))
    lines = (element("tr", *(element("td", cell) for cell in row)) for row in rows)
    parts = (*((element("thead", head),) if any(names) else ()), element("tbody", *lines))
    return element("div", element("table", *parts, class_=kind), class_="wide")
