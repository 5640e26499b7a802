"""Windows of a walk, solved again by dynamic programming over a frontier.

A window is a rectangle of cells; the walk outside of it stays. The method is Knuth's Simpath (The
Art of Computer Programming, volume 4A, section 7.1.4), which Inoue and Minato name the frontier
method (2016), here for a walk that may visit a cell more than once:

* A walk is taken apart into passages (``passages``). A step is walked at most twice, so each of the
  four sides of a cell has two lanes. A passage enters a cell by a lane and leaves it by another.
* The cells of the window are decided one by one, line by line (``window``): for each cell its
  passages are chosen (``choices``). The frontier is the border between decided and undecided cells.
* The passages chosen so far form pieces of the walk. A state (``states``) is what the undecided
  cells need to know of them: which lanes at the frontier and at the window's rim are open ends, and
  for each open end its mate, the other end of the same piece. The walk outside the window joins the
  ends at the rim, so these pieces are the first state.
* Each state before a cell, with each choice for the cell, gives a state after it (``choices``). Of
  equal states the cheapest is kept; so the program is exact unless the beam, a limit on the states,
  drops some.
* A passage that joins the two ends of one piece closes a ring. That is allowed once, for the last
  passage: then one ring is left, which is the walk (closed outside of the ground, from its end to
  its beginning).
* States that cannot cover the rest (``parts``), or cannot become cheaper than the present walk, are
  dropped. The passages of the cheapest last state are put back into the walk (``program``).

``search`` solves window after window. ``memory`` has all arrays of the program.
"""
