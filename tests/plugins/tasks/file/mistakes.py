"""Mistakes in a scene file: what is replaced, by what, and how the one line that says so begins."""

GOOD = """\
name: OpenDoor
description: A door stands ajar on the table, and a ball rolls by. Open the door, and put the ball on the mark.
bodies:
  - name: post
    box: [0.04, 0.04, 0.4]
    position: [0.8, 0.3, 0.2]
    fixed: true
  - name: door
    parts:
      - {box: [0.3, 0.02, 0.3], color: sienna}
      - {sphere: {radius: 0.02}, position: [-0.1, 0.03, 0]}
    position: [0.8, 0.1, 0.2]
    rpy_deg: [0, 0, 90]
    density: 600
  - name: ball
    sphere: {radius: 0.04}
    position: [0.6, -0.2, 0.04]
    mass: 0.2
    velocity: [0.1, 0, 0]
marks:
  - {name: spot, position: [0.5, -0.3, 0]}
joints:
  - name: hinge
    kind: hinge
    body: door
    parent: post
    origin: [0.16, 0, 0]
    upper: 1.5
    lower: 0
    start: 0
    latches: [{at: 0, force: 2, width: 0.05}]
goals:
  - {joint: hinge, to: 1.2, tolerance: 0.1}
  - {bodies: [ball], at: spot, place: [0, 0, 0.04], tolerance: 0.03, weight: 2}
every: true
camera: {position: [1.5, -1, 1], target: [0.6, 0, 0.1]}
variations:
  near:
    bodies.ball.position.x: [0.55, 0.65]
    joints.hinge.start: [0, 0.2]
"""

MISTAKES = [
    ("name: OpenDoor\n", "", "line 1: name: is missing; add it"),
    (
        "name: OpenDoor",
        "nmae: OpenDoor",
        "line 1: nmae: no key 'nmae' (did you mean 'name'?); possible: bodies, camera, description, every,",
    ),
    (
        "name: OpenDoor",
        "name: Open Door",
        "line 1: name: must be a name of letters, digits and '_', a letter first, got 'Open Door'",
    ),
    ("name: OpenDoor", "name: 7", "line 1: name: must be a text; put it in quotes, got 7"),
    ("name: OpenDoor", "name: [OpenDoor", "line 2: this is no YAML: expected ',' or ']', but got ':'"),
    ("name: OpenDoor", "name: OpenDoor\nname: Twice", "line 2: name: this key is written twice; leave one of them out"),
    ("name: OpenDoor", "name: &a OpenDoor", "line 1: anchors (&a and *a) are not read; write it out"),
    ("name: OpenDoor", "name: *a", "line 1: anchors (&a and *a) are not read; write it out"),
    (
        "name: OpenDoor",
        "name: !!python/object:os.system x",
        "line 1: tags (tag:yaml.org,2002:python/object:os.system) are not read; leave it out",
    ),
    (
        "name: OpenDoor",
        "\tname: OpenDoor",
        "line 1: this is no YAML: found character '\\t' that cannot start any token",
    ),
    ("name: OpenDoor", "? [a, b]\n: 3\nname: OpenDoor", "line 1: a key must be a word"),
    (
        "every: true",
        "every: [[[[[[[[[[[[[[]]]]]]]]]]]]]]",
        "line 35: at most 12 levels of nesting are read; make it flatter",
    ),
    ("every: true", "every: yes", "line 35: every: must be true or false, got 'yes'"),
    ("every: true", "every: 1", "line 35: every: must be true or false, got 1"),
    (
        "A door stands ajar on the table, and a ball rolls by. Open the door, and put the ball on the mark.",
        "Open it.",
        "line 2: description: must have at least 20 characters, got 'Open it.'",
    ),
    ("box: [0.04, 0.04, 0.4]", "box: [0.04, 0.04]", "line 5: bodies[0].box[2]: is missing; add it"),
    ("box: [0.04, 0.04, 0.4]", "box: [0.04, 0.04, 0.4, 1]", "line 5: bodies[0].box: must have at most 3 items, not 4"),
    ("box: [0.04, 0.04, 0.4]", "box: [0.04, 0.04, -0.4]", "line 5: bodies[0].box[2]: must be greater than 0, got -0.4"),
    ("box: [0.04, 0.04, 0.4]", "box: 0.04", "line 5: bodies[0].box: must be a list, such as [0, 0, 0.1], got 0.04"),
    (
        "box: [0.04, 0.04, 0.4]",
        "bx: [0.04, 0.04, 0.4]",
        "line 5: bodies[0].bx: no key 'bx' (did you mean 'box'?); possible: at, box, capsule, color, cylinder,",
    ),
    (
        "    box: [0.04, 0.04, 0.4]\n",
        "",
        "line 4: bodies[0]: needs one of box, sphere, cylinder, capsule, parts, file; there is none",
    ),
    (
        "box: [0.04, 0.04, 0.4]",
        "box: [0.04, 0.04, 0.4]\n    sphere: {radius: 1}",
        "line 4: bodies[0]: needs one of box, sphere, cylinder, capsule, parts, file; there are box, sphere",
    ),
    (
        "    sphere: {radius: 0.04}",
        "    sphere: 0.04",
        "line 16: bodies[2].sphere: must be an object of keys and values, such as {radius: 0.1}, got 0.04",
    ),
    (
        "    sphere: {radius: 0.04}",
        "    sphere: {radius: 0}",
        "line 16: bodies[2].sphere.radius: must be greater than 0, got 0",
    ),
    (
        "    sphere: {radius: 0.04}",
        "    sphere: {raduis: 0.04}",
        "line 16: bodies[2].sphere.raduis: no key 'raduis' (did you mean 'radius'?); possible: radius",
    ),
    (
        "    sphere: {radius: 0.04}",
        "    cylinder: {radius: 0.04}",
        "line 16: bodies[2].cylinder.length: is missing; add it",
    ),
    (
        "    sphere: {radius: 0.04}",
        "    file: ../ball.stl",
        "line 15: bodies[2]: ../ball.stl is not in the scene's folder; put it there",
    ),
    ("    sphere: {radius: 0.04}", "    file: ball.stl", "line 15: bodies[2]: there is no mesh"),
    (
        "    sphere: {radius: 0.04}",
        "    file: ball.urdf",
        "line 15: bodies[2]: ball.urdf holds bodies of its own; name it under imports, not as the shape of a",
    ),
    ("    sphere: {radius: 0.04}", "    file: ball.step", "line 15: bodies[2]: mesh"),
    (
        "    sphere: {radius: 0.04}",
        "    sphere: {radius: 0.04}\n    scale: 2",
        "line 15: bodies[2]: scale is for a body with a file",
    ),
    (
        "color: sienna",
        "color: siena",
        "line 10: bodies[1].parts[0].color: must be a colour such as red, seagreen or '#3366cc', got 'siena'",
    ),
    (
        "color: sienna",
        "colour: sienna",
        "line 10: bodies[1].parts[0].colour: no key 'colour' (did you mean 'color'?); possible: box,",
    ),
    (
        "      - {box: [0.3, 0.02, 0.3], color: sienna}\n",
        "      - {position: [0, 0, 0]}\n",
        "line 10: bodies[1].parts[0]: needs one of box, sphere, cylinder, capsule; there is none",
    ),
    ("    fixed: true\n", "", "line 4: bodies[0]: needs one of mass, density, fixed; there is none"),
    (
        "    fixed: true\n",
        "    fixed: false\n",
        "line 4: bodies[0]: fixed: false says nothing; leave it out, and give a mass or a density",
    ),
    (
        "    fixed: true\n",
        "    fixed: true\n    mass: 3\n",
        "line 4: bodies[0]: needs one of mass, density, fixed; there are mass, fixed",
    ),
    (
        "    mass: 0.2\n",
        "    mass: -0.2\n",
        "line 18: bodies[2].mass: must be greater than or equal to 0.00001, got -0.2",
    ),
    ("    mass: 0.2\n", "    mass: 0.2 kg\n", "line 18: bodies[2].mass: must be a number, got '0.2 kg'"),
    ("    mass: 0.2\n", "    mass: .nan\n", "line 18: bodies[2].mass: must be a number, got '.nan'"),
    ("    mass: 0.2\n", "    mass: 1e999\n", "line 18: bodies[2].mass: the number 1e999 is too large"),
    (
        "    mass: 0.2\n",
        "    fixed: true\n",
        "line 15: bodies[2]: body 'ball': a velocity needs finite numbers, and a mass above 0",
    ),
    (
        "    mass: 0.2\n",
        "    mass: 0.2\n    friction: 50\n",
        "line 19: bodies[2].friction: must be less than or equal to 10, got 50",
    ),
    (
        "position: [0.6, -0.2, 0.04]",
        "position: [600, -200, 40]",
        "line 17: bodies[2].position[0]: must be less than or equal to 20, got 600",
    ),
    (
        "rpy_deg: [0, 0, 90]",
        "rpy: [0, 0, 1.57]",
        "line 13: bodies[1].rpy: no key 'rpy' (did you mean 'rpy_deg'?); possible: at, box, capsule, color,",
    ),
    (
        "rpy_deg: [0, 0, 90]",
        "at: ball",  # which comes later
        "line 8: bodies[1]: no body or mark 'ball' in what the file has before it; possible: post, spot",
    ),
    ("rpy_deg: [0, 0, 90]", "rpy_deg: [0, 0, east]", "line 13: bodies[1].rpy_deg[2]: must be a number, got 'east'"),
    ("- name: ball", "- name: door", "line 15: bodies[2].name: 'door' is there already; choose another name"),
    ("- name: ball", "- name: table", "line 15: bodies[2].name: 'table' is there already; choose another name"),
    (
        "- name: ball",
        "- name: the ball",
        "line 15: bodies[2].name: must be a name of letters, digits and '_', a letter first, got 'the ball'",
    ),
    ("kind: hinge", "kind: hing", "line 24: joints[0].kind: must be 'hinge', 'slider' or 'ball', got 'hing'"),
    (
        "body: door",
        "body: dor",
        "line 23: joints[0]: joint 'hinge': there is no body 'dor'; there are: floor, table, spot, post,",
    ),
    ("body: door", "body: post", "line 23: joints[0]: joint 'hinge': its body 'post' is fixed; give it a mass"),
    (
        "body: door",
        "body: ball",
        "line 23: joints[0]: joint 'hinge': its body 'ball' can't start with a velocity; use a drive",
    ),
    (
        "parent: post",
        "parent: pots",
        "line 23: joints[0]: joint 'hinge': there is no body 'pots'; there are: floor, table, spot, post,",
    ),
    ("upper: 1.5", "upper: -1.5", "line 23: joints[0]: joint 'hinge': it starts at 0, outside of its range 0..-1.5"),
    (
        "upper: 1.5",
        "upper: 7",
        "line 23: joints[0]: joint 'hinge': its range must be less than a whole turn, or leave it out",
    ),
    ("    lower: 0\n", "", "line 23: joints[0]: joint 'hinge': give both ends of its range, or neither"),
    (
        "force: 2",
        "force: 0",
        "line 31: joints[0].latches[0]: a latch needs a place, a force up to 10000 and a width above 0, got",
    ),
    (
        "force: 2",
        "strength: 2",
        "line 31: joints[0].latches[0].strength: no key 'strength'; possible: at, force, width",
    ),
    (
        "{at: 0, force: 2, width: 0.05}",
        "3",
        "line 31: joints[0].latches[0]: must be an object of keys and values, such as {radius: 0.1}, got 3",
    ),
    (
        "joint: hinge, to: 1.2",
        "joint: hnge, to: 1.2",
        "line 33: goals[0]: no joint 'hnge' (did you mean 'hinge'?); possible: hinge",
    ),
    (
        "joint: hinge, to: 1.2",
        "joint: hinge",
        "line 33: goals[0]: a goal needs either place or away (the distance from the start), or places, or",
    ),
    (
        "bodies: [ball]",
        "bodies: [bal]",
        "line 34: goals[1]: no body that can move 'bal' (did you mean 'ball'?); possible: ball, door",
    ),
    ("bodies: [ball]", "bodies: [post]", "line 34: goals[1]: no body that can move 'post'; possible: ball, door"),
    ("bodies: [ball]", "bodies: ball", "line 34: goals[1].bodies: must be a list, such as [0, 0, 0.1], got 'ball'"),
    (
        "at: spot",
        "at: spt",
        "line 34: goals[1]: no body 'spt' (did you mean 'spot'?); possible: ball, door, floor, post, spot,",
    ),
    (
        "place: [0, 0, 0.04]",
        "place: [0, 0, 0.04], away: 1",
        "line 34: goals[1]: a goal needs either place or away (the distance from the start), or places, or",
    ),
    (
        "place: [0, 0, 0.04], ",
        "",
        "line 34: goals[1]: a goal needs either place or away (the distance from the start), or places, or",
    ),
    (
        "weight: 2",
        "weight: 0",
        "line 34: goals[1]: a goal's tolerances and max_force_n must be 0 or more, its weight above 0",
    ),
    (
        "weight: 2",
        "wieght: 2",
        "line 34: goals[1].wieght: no key 'wieght' (did you mean 'weight'?); possible: after, any, at, away,",
    ),
    ("weight: 2", "after: door", "line 34: goals[1]: no goal 'door'; possible: none"),
    (
        "target: [0.6, 0, 0.1]",
        "target: [1.5, -1, 1]",
        "line 36: camera: the camera's position and target are one point; move one of them",
    ),
    ("target: [0.6, 0, 0.1]", "fov_deg: wide", "line 36: camera.fov_deg: must be a number, got 'wide'"),
    (
        "bodies.ball.position.x: [0.55, 0.65]",
        "bodies.ball.position.x: [0.65, 0.55]",
        "line 39: variations.near.bodies.ball.position.x: its range is from 0.65 to 0.55; write the lower",
    ),
    (
        "bodies.ball.position.x: [0.55, 0.65]",
        "bodies.ball.position.x: 0.55",
        "line 39: variations.near.bodies.ball.position.x: must be a list, such as [0, 0, 0.1], got 0.55",
    ),
    (
        "bodies.ball.position.x: [0.55, 0.65]",
        "bodies.bal.position.x: [0.55, 0.65]",
        "line 39: variations.near.bodies.bal.position.x: there is no such number; a range needs a number",
    ),
    (
        "bodies.ball.position.x: [0.55, 0.65]",
        "bodies.ball.mass: [-1, 1]",
        "line 39: variations.near.bodies.ball.mass: -1 can't be: my_scene.yaml, line 18: bodies[2].mass:",
    ),
    (
        "bodies.ball.position.x: [0.55, 0.65]",
        "bodies.ball.rpy_deg.yaw: [0, 90]",
        "line 39: variations.near.bodies.ball.rpy_deg.yaw: there is no such number; a range needs a number",
    ),
    (
        "bodies.ball.position.x: [0.55, 0.65]",
        "goals.0.to: [0.55, 0.65]",
        "line 39: variations.near.goals.0.to: only numbers of bodies, imports, marks, joints can vary; to",
    ),
    (
        "    joints.hinge.start: [0, 0.2]",
        "    joints.hinge.start: [-1, 2]",
        "line 40: variations.near.joints.hinge.start: -1 can't be: joint 'hinge': it starts at -1, outside",
    ),
    ("  near:", "  none:", "line 37: variations: the variation 'none' draws nothing; give it another name"),
    (
        "every: true",
        "every: true\nbodis: []",
        "line 36: bodis: no key 'bodis' (did you mean 'bodies'?); possible: bodies, camera, description,",
    ),
    ("every: true", "every: true\nimports: [{file: robot.urdf}]", "line 36: imports[0]: there is no URDF"),
    (
        "every: true",
        "every: true\nimports: [{file: robot.stl}]",
        "line 36: imports[0]: robot.stl is no .urdf, .xml, .mjcf; a mesh is the `file` of a body, not an",
    ),
    (
        "every: true",
        "every: true\nhome: [0.5, 0, 0.5]",
        "line 36: home: must be an object of keys and values, such as {radius: 0.1}",
    ),
    (
        "every: true",
        "every: true\nsuccess_reward: 2",
        "line 36: success_reward: must be less than or equal to 1, got 2",
    ),
    (
        "every: true",
        'every: "\\ud800"',
        "line 1: it holds a character that is no text, such as half of a pair; leave it out",
    ),
    (
        "every: true",
        "every: \x01",
        ': this is no YAML: unacceptable character #x0001: special characters are not allowed in "<unicode',
    ),
]
