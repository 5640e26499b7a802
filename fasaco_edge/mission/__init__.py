"""Mission: what to cover and when to replan; events in, decisions out.

Read in this order:

    core/mission         step(events, now) -> Decision: the whole interface
    core/events          events and decisions
    core/event_handler   applies each event
    core/order_changes   begins orders, and carries out commands
    core/executive       then decides what the robot does next: a list of rules, in their order
    core/errands, order_work, path_checks, way_out   what the rules do
    core/route           owns the path and the pending plan; better paths in spare time

    map/map_state        owns the map, the robot's cell and the reachable area
    map/inputs           selects the frame; timeouts and jumps of maps and poses
    map/reachable_area   reachable cells, updated incrementally
    map/loop_closure     whether a map has moved, and which cells are then uncertain

    map/room_book        owns the rooms: their numbers, names, settings, and where they are
    map/room_matching    assigns the regions of a new map to known rooms

    coverage/mission_ledger  owns the ledger, until a map contradicts it
    coverage/fit         whether a map contradicts the ledger
    coverage/ledger      covered cells
    coverage/progress    progress on the path, of the coverage, of each zone
    coverage/unreached   uncovered cells, and the causes

    company              the interface to other robots; here, that of a single robot

    orders/sequencer     owns the order: zones, passes, retries, return home
    orders/present_part  the cells planned now, and when the robot gives them up
    orders/order_state   an order and its progress; kept on disk with the ledger
    orders/order         orders, and their JSON or YAML form
    orders/placing       finds the zones and rooms that an order names
    orders/zones         an order's polygons on the lattice
"""
