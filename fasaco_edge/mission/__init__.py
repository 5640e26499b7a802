"""What is covered, what changed, when to replan: events in, decisions out.

Read in this order:

    mission      step(events, now) -> Decision: all there is, for whoever uses it
    events       what goes in and comes out
    intake       each event changes the parts
    pilot        then the parts decide: states, and what the robot does next
    parts        site    the map, the robot's place in it, what it can reach (ground)
                 log     what is covered (ledger), and whether a map contradicts it (fit) or has
                         moved (loop_closure)
                 watch   whether map and pose keep coming, and can be believed
                 agenda  what is still to be done: zones, passes, tries, the way home; where to
                         look from only (lookout, frontier)
                 route   the path, and the plan under way; attempts at a better one (spare_time)
    assignment   an order and how far it is; kept on disk with the ledger
    order        what can be ordered; order_document: the same as JSON or YAML
    polygons, zones, connected, unreached: an order's areas on the lattice
"""
