"""Hands, in files of their own or on an arm."""


def hand(second="0 -1 0", effort=' effort="10"'):
    """Two slides on one palm."""
    slides = "".join(
        f'<joint name="slide_{side}" type="prismatic"><parent link="palm"/><child link="{side}"/>'
        f'<axis xyz="{axis}"/><limit lower="0" upper="0.04"{effort} velocity="1"/></joint>'
        for side, axis in (("a", "0 1 0"), ("b", second))
    )
    return f'<robot name="hand"><link name="palm"/><link name="a"/><link name="b"/>{slides}</robot>'


def gripped(
    kinds=("prismatic", "prismatic"),
    right='<axis xyz="0 -1 0"/><mimic joint="left"/>',
    lower="0",
    fixed="tool0",
):
    """The changes that give the arm a gripper."""
    box = '<geometry><box size="0.02 0.02 0.04"/></geometry>'
    inertia = '<inertial><mass value="0.1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4"/></inertial>'
    links = "".join(
        f'<link name="{name}">{inertia}<collision><origin xyz="0 0 0.02"/>{box}</collision></link>'
        for name in ("hand_base", "finger_l", "finger_r")
    )
    joints = f'<joint name="on" type="fixed"><parent link="{fixed}"/><child link="hand_base"/></joint>'
    limit = f'<limit lower="{lower}" upper="0.03" effort="25" velocity="0.1"/>'
    for name, kind, more in (
        ("left", kinds[0], f'<axis xyz="0 1 0"/>{limit}'),
        ("right", kinds[1], right),
    ):
        ends = f'<origin xyz="0 0 0.04"/><parent link="hand_base"/><child link="finger_{name[0]}"/>'
        joints += f'<joint name="{name}" type="{kind}">{ends}{more}</joint>'
    return [("</robot>", f"{links}{joints}</robot>")]
