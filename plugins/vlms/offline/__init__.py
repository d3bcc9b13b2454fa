"""The embedded designer: tools and plans by classical means, without a language model.

An answer comes about by rejection sampling, and later by a genetic algorithm. The terms, each defined in its module:

- `scene_analysis`: a `Solid` is a body with its corners and boxes. A `Subgoal` is some bodies and the shift that brings
  them to their goal; a goal gives one or several.
- `heads`: a `Head` is the working end of a tool, such as a blade, a scoop or a hook, sized by a subgoal.
- `primitives`: a motion primitive is a way of using a head: push, scoop, hook or clamp. It adds waypoints to a `Path`
  (`plans`), which the head follows through the world.
- `guided`: heads with primitives of their own, where a joint or another body leaves one way only. `raycast` finds where
  they get in.
- `tools`: a tool is a head and a shaft that connects it to the mount. In a tool of any origin the foot is taken for the
  head.
- `sampler`: the `Sampler` draws subgoals, a head, a path and a mount, counts the faults of what came of it, and keeps
  the sample with the fewest.
- `evolve`: mutates and crosses the tools of elites, and varies their plans.
- `several`: tools with a part for each of several tasks.
- `designer`: the model that a run asks, from the brief to the reply.
"""
