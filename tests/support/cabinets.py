"""A cabinet as a URDF file, by its links and joints."""

BOX = '<collision><geometry><box size="0.1 0.2 0.3"/></geometry></collision>'


def link(name, inside=BOX, mass=2.0):
    return f'<link name="{name}"><inertial><mass value="{mass}"/></inertial>{inside}</link>'


def joint(name, kind, parent, child, inside=""):
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{inside}</joint>'


def cabinet(
    limit='<limit lower="0" upper="0.3" effort="1" velocity="1"/>',
    kind="prismatic",
    more="",
):
    handle = '<origin xyz="0.2 0 0"/>'
    parts = [
        link("case"),
        link("drawer"),
        link("handle", mass=0.5),
        joint("glue", "fixed", "drawer", "handle", handle),
    ]
    inside = f'<origin xyz="0 0 0.5" rpy="0 0 1.5707963267948966"/><axis xyz="1 0 0"/>{limit}{more}'
    return "".join([*parts, joint("rail", kind, "case", "drawer", inside)])


def mesh(name, tag="collision"):
    return (
        f'<{tag}><geometry><mesh filename="{name}" scale="2 2 2"/></geometry></{tag}>'
    )
