"""What a scene file is refused for; a wrong entry has the reasons of `core.support.inputs`."""

from core.errors import Reason


class SceneReason(Reason):
    """What a scene file breaks."""

    # --- YAML ---------------------------------------------------------------------------------------------------------

    NO_YAML = "{file}: this is no YAML: {problem}"
    YAML_OBJECT = (
        "{file}: a scene is an object of keys and values, such as 'name: PushCup'"
    )
    YAML_KEY = "a key must be a word"
    YAML_TWICE = "this key is written twice; leave one of them out"
    YAML_NUMBER = "the number {given} is too large"
    YAML_TAG = "tags ({tag}) are not read; leave it out"
    YAML_ANCHOR = "anchors (&{anchor} and *{anchor}) are not read; write it out"
    YAML_DEPTH = "at most {most} levels of nesting are read; make it flatter"

    # --- scenes -------------------------------------------------------------------------------------------------------

    ONE_OF = "needs one of {possible}; there {found}"
    SCENE_COUNT = "a scene can have {most} bodies, not {count}; take fewer"
    SCENE_NAME = "{name!r} is there already; choose another name"
    SCENE_FIXTURE_NAME = "{name!r} is what a design brings; choose another name"
    NOTHING_MOVES = (
        "nothing can move, so nothing can be earned; give a body a mass{hint}"
    )
    NOTHING_EARNED = (
        "they only say what must not happen (keep, untouched, throughout), so nothing can be earned; add what "
        "is to be reached, such as {{bodies: [cup], raised: 0.1}}"
    )
    NO_FIXTURE = (
        "they name the fixture that a design brings, and this scene has no place for one; add where it may "
        "stand, such as fixture: {{box: [0.3, 0.3, 0.3], position: [0.6, 0, 0.15]}}"
    )
    GOAL_CIRCLE = "it must be fulfilled before itself; name an earlier goal"
    GOAL_CONFLICT = "{problem}"
