"""The mission: what is covered, what changed, when to replan: events in, decisions out.

Read in this order:

    core/mission         step(events, now) -> Decision: all there is for its users
    core/events          what goes in and comes out
    core/event_handler   what each event changes
    core/executive       then: the state, and what the robot does next
    core/route           owns the path and the plan under way; better paths in spare time

    map/map_state        owns the map, the robot's place in it and what it can reach
    map/inputs           the active frame; whether map and pose keep coming and can be believed
    map/reachable_area   what can be reached, at the cost of what changed
    map/loop_closure     whether a map has moved, and what that makes uncertain

    coverage/mission_ledger  owns the ledger; whether a map contradicts it
    coverage/ledger      what is covered, cell by cell
    coverage/progress    on the path, of the coverage, of each zone
    coverage/unreached   what stays uncovered, and why

    fleet/layer          the other robots, and this one's part of what is left
    fleet/shared         which cells they have swept
    fleet/division       who sweeps what

    orders/sequencer     owns the order: zones, passes, tries, the way home
    orders/order_state   an order and how far it is; kept on disk with the ledger
    orders/order         what can be ordered, and its JSON or YAML form
    orders/zones         an order's polygons on the lattice
"""
