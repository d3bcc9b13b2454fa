"""The embedded designer: tools and plans by classical means, without a language model.

An answer comes about by rejection sampling, and later by a genetic algorithm. Each term is defined in its module:

- The scene. A `Solid` is a body as corners and boxes (`boxes`), a `SceneModel` a layout's solids, with
  the arm's workspace. `SceneAnalysis` draws what the goals ask for: a `Subgoal` (`subgoals`) is some bodies, and the
  shift that brings them to their goal.
- The tool. A `Head` (`heads`, `head_sampling`) is its working end, such as a blade, a scoop or a hook, sized by a
  subgoal. `tool_building` adds a shaft that connects it to the mount, `mounting` chooses where it is there. In a tool
  of any origin, the lowest boxes are taken for its head (`tools`).
- The motion. A motion primitive (`primitives`) is a way of using a head: push, scoop, hook, clamp or cup. It adds
  waypoints to a `HeadPath` (`paths`). Where a joint, another body or a container leaves one way only, heads have their
  own motions (`guided`, `hanging`, `reaching_in`, `pouring`, `ladling`); `raycast` finds where they get in. So have
  those for what lies free and asks for more than a primitive (`clips`, `cups`, `detours`, `catching`, `hand_turning`).
  What must get lower than what it stands on goes over an edge (`edges`), and what is to end below something goes in
  from the side (`sheltered`, `below_roof`). What is to stay higher by itself is hung on a peg (`pegs`).
- The search. The `Sampler` draws subgoals, a head, a path and a mount, counts the `faults` of what came of it, and
  keeps the sample with the fewest. `evolve` breeds from `parents`: `tool_variation` and `plan_variation`.
- The answer. `anchoring` and `plan_writing` write plans that move with the layout, `written_design` a tool with its
  plans, `answer` a brief's document; `given_tools` and `several` are for tools that are given, or must do several
  tasks. `designer` is the model that a run asks.
"""
