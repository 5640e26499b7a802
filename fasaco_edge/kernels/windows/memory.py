"""Memory of the dynamic program, prices of the walk, and rules for the cell that is decided.

An open end of a piece of the walk has an identifier. Identifiers ``2 * column + lane`` are lanes of
the frontier below the decided cells, two more are the lanes ahead of the cell that is decided, then
come the slots at the window's rim, and four spare ones for the lanes that lead into that cell. A
state is an array by identifier: the mate of each open end, or NO_END.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fasaco_edge.kernels.jit import inlined

# In place of a mate: the slot is no open end. A cost above all costs.
NO_END = -1
TOO_MUCH = 1 << 60

# Limit on the identifiers of a state; windows that need more are not solved.
MOST_IDS = 192
# Limit on the choices for a cell, and number of kinds of incoming sides with a list of choices.
MOST_CHOICES, KINDS = 600, 18
# Limit on the passages of one cell. The numbers of pairings of 0, 2, 4, 6 and 8 slots, and the
# index of the first pairing of each.
MOST_PAIRS = 4
PAIRINGS = 1 + 1 + 3 + 15 + 105
FIRST_PAIRING = (0, 1, 2, 5, 20, 125)
# The code of a choice: its number of bits; the first bit of the lanes ahead, of the lanes below and
# of the end; the mask of its pairing in the lowest bits.
CODE_BITS, AHEAD, BELOW, ENDING, PAIRING = 12, 10, 8, 7, 127
FIRST_NEW, SECOND_NEW, NO_PAIR = 1, 2, 4


class Choices(NamedTuple):
    """A cell's choices by kind of incoming sides, cheapest first.

    Attributes:
        listed: int32 (KINDS,), number of choices; -1 if they are not listed yet.
        keys: int64 (KINDS, MOST_CHOICES): cost, and in the lowest CODE_BITS the code: lanes ahead,
            lanes below, whether the walk ends here, pairing.
        named: int32 (KINDS,), number of choices whose ends are listed in ``ends``.
        ends: int16 (KINDS, MOST_CHOICES, 2 * MOST_PAIRS), identifiers that are paired up.
        new_ends: uint8 (KINDS, MOST_CHOICES, MOST_PAIRS), which of the two are new: FIRST_NEW,
            SECOND_NEW, both or neither; NO_PAIR after the last pair.
    """

    listed: NDArray[np.int32]
    keys: NDArray[np.int64]
    named: NDArray[np.int32]
    ends: NDArray[np.int16]
    new_ends: NDArray[np.uint8]


class Parts(NamedTuple):
    """The undecided cells of a window, and their connected parts.

    Attributes:
        label: int32 (n,), the part of each such cell.
        root: int32 (n,), working memory; number int32 (n,), place of a cell in the order.
        queue: int32 (most cells,), working memory.
        splits: uint8 (most cells,), whether the cell is a cut vertex of its part.
        left: int32 (most cells,), cells left of each part; needed int32, those that need a visit.
        leads: int16 (MOST_IDS, 2), identifiers that lead into a part, and the part.
        sizes: int64 (2,), numbers of parts and of identifiers.
    """

    label: NDArray[np.int32]
    root: NDArray[np.int32]
    number: NDArray[np.int32]
    queue: NDArray[np.int32]
    splits: NDArray[np.uint8]
    left: NDArray[np.int32]
    needed: NDArray[np.int32]
    leads: NDArray[np.int16]
    sizes: NDArray[np.int64]


class States(NamedTuple):
    """States before and after a cell.

    Attributes:
        mates: int16 (2, states, MOST_IDS), the states, see above: one layer before the cell, and
            one after it.
        words: int64 (2, states, MOST_IDS / 4), the same memory.
        cost: int64 (2, states).
        closed: uint8 (2, states), whether the ring is closed.
        parent, code: int32, int64 (states,): predecessor and choice of the states of the layer
            after.
        hash: int64 (states,), of the states of the layer after.
        table: int64 (slots,), stamp of the layer and number of a state, by its hash.
        order: int64 (states,), costs while the most expensive are dropped.
        scratch, base: int16 (MOST_IDS,), the new state with the cell's ends, and without them;
            scratch_words, base_words int64 (MOST_IDS / 4,), the same memory.
        clock: int64 (2,): stamp of the layer; states expanded so far.
    """

    mates: NDArray[np.int16]
    words: NDArray[np.int64]
    cost: NDArray[np.int64]
    closed: NDArray[np.uint8]
    parent: NDArray[np.int32]
    code: NDArray[np.int64]
    hash: NDArray[np.int64]
    table: NDArray[np.int64]
    order: NDArray[np.int64]
    scratch: NDArray[np.int16]
    scratch_words: NDArray[np.int64]
    base: NDArray[np.int16]
    base_words: NDArray[np.int64]
    clock: NDArray[np.int64]


class WindowCells(NamedTuple):
    """The cells of the window, and the slots at its rim.

    Attributes:
        listed: int32 (most cells,), in order.
        inside: uint8 (n,), 1 in the window.
        ident: int16 (n, SLOTS), identifier of a slot at the rim.
        rim: int32 (MOST_IDS, 2), cell and slot of each identifier at the rim.
    """

    listed: NDArray[np.int32]
    inside: NDArray[np.uint8]
    ident: NDArray[np.int16]
    rim: NDArray[np.int32]


class Program(NamedTuple):
    """Memory of the program.

    Attributes:
        pairs: int8 (PAIRINGS, 2 * MOST_PAIRS), the slots that each pairing joins.
        choice: of the cell that is decided.
        states: the states before and after it.
        kept_parent, kept_code: int32, int64 (most cells + 1, beam), predecessors and choices of
            the states of all layers.
        cells: of the window.
        reduced: int64 (most cells, 6, 6), costs of passages by the directions of their sides.
        left: int64 (most cells + 1,), least cost of the cells from here on.
        taken: int16 (12,), identifiers of the slots that a cell has; sides int64 (12,), their
            directions.
        at: int64 (11,), its progress: entries NUMBER to RING_PRICE.
        parts: the connected parts of the undecided cells.
    """

    pairs: NDArray[np.int8]
    choice: Choices
    states: States
    kept_parent: NDArray[np.int32]
    kept_code: NDArray[np.int64]
    cells: WindowCells
    reduced: NDArray[np.int64]
    left: NDArray[np.int64]
    taken: NDArray[np.int16]
    sides: NDArray[np.int64]
    at: NDArray[np.int64]
    parts: Parts


class WalkPrices(NamedTuple):
    """Costs and end of the walk.

    Attributes:
        step, turn: a step and a quarter-turn [half us].
        prices: int64 (n, 4), additional price at a side of a cell, by direction, with ``row``,
            ``col`` and ``room``.
        begin_price, end_price: additional price of its first and its last visit.
        free_end: whether it may end in any cell to cover.
        row, col: added to half a step along a row, along a column [half us].
        room: added to half a step into another room [half us].
    """

    step: int
    turn: int
    prices: NDArray[np.int64]
    begin_price: int
    end_price: int
    free_end: bool
    row: int = 0
    col: int = 0
    room: int = 0


LAYER_STAMP, EXPANDED = 0, 1

# Entries of ``Program.at``: number and line of the next cell; the layer before it and the number of
# its states; the cost that a result must stay below; number of cells in the window, and the last
# cell that needs a passage; number of identifiers; identifiers of the walk's begin and end, -1 for
# outside the window; price of each ring except the first, 0 if there must be one.
NUMBER, LINE, LAYER, STATES, LIMIT, COUNT, LAST, IDS, BEGIN_ID, END_ID, RING_PRICE = range(11)


class CurrentCell(NamedTuple):
    """The cell being decided.

    Attributes:
        cell, number: the cell, and its number in the window.
        behind, above, ahead, below: directions.
        from_behind, from_above: whether these sides come from the frontier; else from the rim.
        to_ahead, to_below: whether these lead on inside the window.
        below_id, ahead_id: first identifiers at the frontier.
        spare_id: the first of four free ones.
    """

    cell: int
    number: int
    behind: int
    above: int
    ahead: int
    below: int
    from_behind: bool
    from_above: bool
    to_ahead: bool
    to_below: bool
    below_id: int
    ahead_id: int
    spare_id: int


class EndRules(NamedTuple):
    """The walk's ends and ring rules at a cell.

    Attributes:
        begin_id: identifier of the walk's beginning if it is in this cell, else -1.
        end_id: identifier of the walk's end if that is in the window, else -1.
        is_needed: whether the cell must have a passage.
        may_close: whether a ring may close: no later cell needs a passage, or several rings may.
        ring_price: price of each ring except the first; 0 if there must be one.
        is_given: whether the walk must end in this cell.
        is_free: whether the walk may still end in any cell that is left.
        is_checked: whether to check the number of ends that lead into each remaining part.
    """

    begin_id: int
    end_id: int
    is_needed: bool
    may_close: bool
    ring_price: int
    is_given: bool
    is_free: bool
    is_checked: bool


@inlined
def lanes_at_rim(ident: NDArray[np.int16], cell: int, direction: int) -> int:
    """Return how many lanes of a side lead out of the window; the first lanes are used first."""
    if ident[cell, 2 * direction] == NO_END:
        return 0
    return 1 if ident[cell, 2 * direction + 1] == NO_END else 2
