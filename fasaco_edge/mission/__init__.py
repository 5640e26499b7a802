"""Mission: what to cover and when to replan; events in, decisions out.

A folder imports only folders below it, and the files beside them: from top to bottom

    core        step(events, now) -> Decision: applies events, then decides by rules in their order
    line        the line that is driven, between the walk over cells and the published path
    path        the published path, pending plans, and the trail from which ants start
    work        what is left of an order, which part comes next, and how it ends
    map         the newest map, its lattice and reachable cells, configured places
    rooms       rooms found on maps, with numbers, names and settings
    company     the interface to other robots; here, that of a single robot
    coverage    covered cells and swept floor, kept through loop closures and restarts
    events      events and decisions; config: configuration
    orders      orders and commands as people give them

Read first: events, core/mission, core/event_handler, core/executive, path/route, map/map_state,
work/sequencer, coverage/mission_ledger, rooms/room_book.
"""
