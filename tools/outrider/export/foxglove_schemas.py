"""JSON Schemas of the Foxglove messages that the export uses.

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

_STAMP = struct("time", sec=integer("s"), nsec=integer("ns"))
_DURATION = struct("duration", sec=integer("s"), nsec=integer("ns"))
_XYZ = struct("m", x=number(), y=number(), z=number())
_RATIOS = struct("scale factor along each axis", x=number(), y=number(), z=number())
_QUATERNION = struct("quaternion", x=number(), y=number(), z=number(), w=number())
_POSE = struct("position and orientation in the frame", position=_XYZ, orientation=_QUATERNION)
_COLOR = struct("colour and opacity, each from 0 to 1", r=number(), g=number(), b=number(), a=number())
_PAIR = struct("additional information", key=words(), value=words())
_POINTS = many(_XYZ)
_COLORS = many(_COLOR)
_INDICES = many(integer())

FRAME_TRANSFORMS: Final = schema(
    "foxglove.FrameTransforms",
    "coordinate transforms between frames",
    transforms=many(
        struct(
            "pose of the child frame in the parent frame",
            timestamp=_STAMP,
            parent_frame_id=words(),
            child_frame_id=words(),
            translation=_XYZ,
            rotation=_QUATERNION,
        )
    ),
)

_ENTITY = struct(
    "object in the 3D scene",
    timestamp=_STAMP,
    frame_id=words("frame of reference of its poses"),
    id=words("a later entity with the same id on the same topic replaces this one"),
    lifetime=_DURATION,
    frame_locked=flag("whether the entity moves with its frame"),
    metadata=many(_PAIR),
    arrows=many(
        struct(
            "arrow along x of its pose, from the tail; m",
            pose=_POSE,
            shaft_length=number(),
            shaft_diameter=number(),
            head_length=number(),
            head_diameter=number(),
            color=_COLOR,
        )
    ),
    cubes=many(struct("box", pose=_POSE, size=_XYZ, color=_COLOR)),
    spheres=many(struct("sphere or ellipsoid; size: its diameters", pose=_POSE, size=_XYZ, color=_COLOR)),
    cylinders=many(
        struct(
            "cylinder or cone along z of its pose",
            pose=_POSE,
            size=_XYZ,
            bottom_scale=number("ratio of the bottom's diameter to size, 0 to 1"),
            top_scale=number("ratio of the top's diameter to size, 0 to 1"),
            color=_COLOR,
        )
    ),
    lines=many(
        struct(
            "line through points",
            type=choice("connection of the points", LINE_STRIP=0, LINE_LOOP=1, LINE_LIST=2),
            pose=_POSE,
            thickness=number(),
            scale_invariant=flag("whether the thickness is in pixels (true) or m (false)"),
            points=_POINTS,
            color=_COLOR,
            colors=_COLORS,
            indices=_INDICES,
        )
    ),
    triangles=many(
        struct("triangle mesh", pose=_POSE, points=_POINTS, color=_COLOR, colors=_COLORS, indices=_INDICES)
    ),
    texts=many(
        struct(
            "text label",
            pose=_POSE,
            billboard=flag("whether the text always faces the camera"),
            font_size=number(),
            scale_invariant=flag("whether the font size is in pixels (true) or m (false)"),
            color=_COLOR,
            text=words(),
        )
    ),
    models=many(
        struct(
            "3D model, from a file",
            pose=_POSE,
            scale=_RATIOS,
            color=_COLOR,
            override_color=flag("whether color replaces the model's own colours"),
            url=words(),
            media_type=words(),
        )
    ),
)

SCENE_UPDATE: Final = schema(
    "foxglove.SceneUpdate",
    "changes of the 3D scene",
    deletions=many(
        struct(
            "deletion of entities",
            timestamp=_STAMP,
            type=choice(
                "entities to delete: the one with this id, or all of the topic", MATCHING_ID=0, ALL=1
            ),
            id=words(),
        )
    ),
    entities=many(_ENTITY),
)

LOCATION_FIX: Final = schema(
    "foxglove.LocationFix",
    "position that a vehicle reports",
    timestamp=_STAMP,
    frame_id=words(),
    latitude=number("deg"),
    longitude=number("deg"),
    altitude=number("m"),
    position_covariance=many(number(), "3 × 3 matrix, m², ENU, row by row", 9),
    position_covariance_type=choice(
        "known part of the covariance", UNKNOWN=0, APPROXIMATED=1, DIAGONAL_KNOWN=2, KNOWN=3
    ),
)

LOG: Final = schema(
    "foxglove.Log",
    "text message of a vehicle",
    timestamp=_STAMP,
    level=choice("severity", UNKNOWN=0, DEBUG=1, INFO=2, WARNING=3, ERROR=4, FATAL=5),
    message=words(),
    name=words("sender"),
    file=words(),
    line=integer(),
)
