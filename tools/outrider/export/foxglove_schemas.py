"""JSON Schemas of those Foxglove messages that the export uses.

Names and fields are those of https://docs.foxglove.dev/docs/sdk/schemas.
"""

from __future__ import annotations

from typing import Final

from outrider.export.json_schema import (
    choice,
    flag,
    integer,
    many,
    number,
    schema,
    struct,
    words,
)

_STAMP = struct("when", sec=integer("s"), nsec=integer("ns"))
_XYZ = struct("m", x=number(), y=number(), z=number())
_TURN = struct("quaternion", x=number(), y=number(), z=number(), w=number())
_POSE = struct("where and how it lies", position=_XYZ, orientation=_TURN)
_COLOR = struct("each from 0 to 1", r=number(), g=number(), b=number(), a=number())
_PAIR = struct("something more about it", key=words(), value=words())
_POINTS = many(_XYZ)
_COLORS = many(_COLOR)
_INDICES = many(integer())

FRAME_TRANSFORMS: Final = schema(
    "foxglove.FrameTransforms",
    "where frames are",
    transforms=many(
        struct(
            "one frame in another",
            timestamp=_STAMP,
            parent_frame_id=words(),
            child_frame_id=words(),
            translation=_XYZ,
            rotation=_TURN,
        )
    ),
)

_ENTITY = struct(
    "something to be seen",
    timestamp=_STAMP,
    frame_id=words("the frame that it is given in"),
    id=words("what comes later under the same name takes its place"),
    lifetime=_STAMP,
    frame_locked=flag("whether it moves along with its frame"),
    metadata=many(_PAIR),
    arrows=many(
        struct(
            "from its tail along x",
            pose=_POSE,
            shaft_length=number(),
            shaft_diameter=number(),
            head_length=number(),
            head_diameter=number(),
            color=_COLOR,
        )
    ),
    cubes=many(struct("a box", pose=_POSE, size=_XYZ, color=_COLOR)),
    spheres=many(struct("a ball, by its diameters", pose=_POSE, size=_XYZ, color=_COLOR)),
    cylinders=many(
        struct(
            "along z",
            pose=_POSE,
            size=_XYZ,
            bottom_scale=number("0 to 1"),
            top_scale=number("0 to 1"),
            color=_COLOR,
        )
    ),
    lines=many(
        struct(
            "points that are joined",
            type=choice("how", LINE_STRIP=0, LINE_LOOP=1, LINE_LIST=2),
            pose=_POSE,
            thickness=number(),
            scale_invariant=flag("whether the thickness is in pixels"),
            points=_POINTS,
            color=_COLOR,
            colors=_COLORS,
            indices=_INDICES,
        )
    ),
    triangles=many(
        struct("a mesh", pose=_POSE, points=_POINTS, color=_COLOR, colors=_COLORS, indices=_INDICES)
    ),
    texts=many(
        struct(
            "a label",
            pose=_POSE,
            billboard=flag("whether it always faces who looks"),
            font_size=number(),
            scale_invariant=flag("whether the size is in pixels"),
            color=_COLOR,
            text=words(),
        )
    ),
    models=many(
        struct(
            "a model",
            pose=_POSE,
            scale=_XYZ,
            color=_COLOR,
            override_color=flag(),
            url=words(),
            media_type=words(),
        )
    ),
)

SCENE_UPDATE: Final = schema(
    "foxglove.SceneUpdate",
    "what there is to be seen",
    deletions=many(
        struct(
            "what goes away",
            timestamp=_STAMP,
            type=choice("which", MATCHING_ID=0, ALL=1),
            id=words(),
        )
    ),
    entities=many(_ENTITY),
)

LOCATION_FIX: Final = schema(
    "foxglove.LocationFix",
    "where a vehicle says it is",
    timestamp=_STAMP,
    frame_id=words(),
    latitude=number("deg"),
    longitude=number("deg"),
    altitude=number("m"),
    position_covariance=many(number(), "m², ENU, by rows", 9),
    position_covariance_type=choice(
        "what is known of it", UNKNOWN=0, APPROXIMATED=1, DIAGONAL_KNOWN=2, KNOWN=3
    ),
)

LOG: Final = schema(
    "foxglove.Log",
    "what a vehicle says in words",
    timestamp=_STAMP,
    level=choice("how bad it is", UNKNOWN=0, DEBUG=1, INFO=2, WARNING=3, ERROR=4, FATAL=5),
    message=words(),
    name=words("who"),
    file=words(),
    line=integer(),
)
