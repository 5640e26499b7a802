"""Mission: what to cover and when to replan; events in, decisions out.

A folder imports only folders and files listed below it:

    core        step(events, now) -> Decision: applies events, then decides by rules in their order
    line        the line that is driven, between the walk over cells and the published path
    path        the published path, pending plans, the trail from which ants start, and what a
                motion of the map moves
    work        what is left of an order, which part comes next, and how it ends
    map         the newest map, its lattice and reachable cells, configured places
    rooms       rooms found on maps, with numbers, names and settings
    company     the interface to other robots; here, that of a single robot
    coverage    covered cells and swept floor, kept through loop closures and restarts
    events      events and decisions; config: configuration
    orders      orders and commands as people give them

A verb has one meaning in all these modules:

    receive, receive_x      take in a message from outside, or a pose, map or plan in it
    record, record_x        keep what the mission itself has found or done
    update, update_x        compute from other state again
    reset; forget_x         forget everything; forget one thing
    begin_x; start_x        begin a phase of work; start a timeout
    continue_from; restore  take over from a predecessor; take over what was kept over a restart

Read first: events, core/mission, core/event_handler, core/executive, path/route, map/map_state,
work/sequencer, coverage/mission_ledger, rooms/room_book.
"""
