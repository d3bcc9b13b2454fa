"""The embedded designer: tools and plans by classical means, without a language model.

It knows some ways of using a tool, each one class in `ways`. Read one of these first, and then:

- `wants` says what a task's goals leave to do, and `job` is that in a `layout`: bodies, where they have to go, and what
  is free around them; `reach` says where the arm works. `options` finds the ways that suit.
- A way makes a head and a motion (`heads`). `mounting` chooses where the head is at the mount, `shafts` carries it
  there, or `hand` hangs it from fingers; `sections` says how thick bars must be. `making` makes the tool and the
  waypoints of it.
- `faults` finds what is wrong with that, and `search` keeps the best of some draws.
- A `recipe` is what a design is made from. `notes` keeps it in documents, and `vary` changes that of elites. `given`
  guesses the head of a tool that is given.
- `answer` makes the document for a brief, `several` for several tasks, and `writing` writes it. `designer` is the model
  that a run asks.
"""
