"""A planner as a user would install it beside the daemon."""


def depth_first(problem):
    """Go to an unvisited neighbour; without one, backtrack."""
    stack, walk, seen = [problem.start], [problem.start], {problem.start}
    while stack:
        ahead = [cell for cell in problem.neighbours(stack[-1]) if cell not in seen]
        if ahead:
            stack.append(ahead[0])
            seen.add(ahead[0])
        else:
            stack.pop()
        walk += stack[-1:]
    return walk
