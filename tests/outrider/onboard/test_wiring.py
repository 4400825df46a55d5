"""Of what passes a physical link a companion gets all that it listens to, and never its own words."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.config import CompanionConfig
from companion.telemetry.reception import LINKS, accepts
from companion.values.components import COMPONENT
from mavlink_bridge.wire.header import Header
from outrider.onboard.wiring import wants

OWN, TARGET = 1, 100
CONFIGS = [
    CompanionConfig(),
    CompanionConfig.model_validate({"target_source": {"kind": "follow_target", "anyone": True}}),
    CompanionConfig.model_validate({"target_source": {"kind": "camera"}}),
    CompanionConfig.model_validate({"target_source": {"kind": "camera", "system": 7}}),
    CompanionConfig.model_validate({"proximity": {}, "traffic": {}}),
]
HEADERS = st.builds(
    Header,
    st.sampled_from([OWN, 2, 7, TARGET, 251, 255]),
    st.sampled_from([1, 100, 156, 190, COMPONENT]),
    st.sampled_from([0, 1, 30, 32, 33, 49, 75, 76, 77, 111, 144, 245, 246, 253, 276, 330, 385]),
)


@pytest.mark.parametrize("name", LINKS)
@given(config=st.sampled_from(CONFIGS), header=HEADERS)
def test_what_it_listens_to_arrives(name: str, config: CompanionConfig, header: Header) -> None:
    accepted = accepts(name, OWN, TARGET, config)(header.message_id, header.system, header.component)
    wanted = wants(name, OWN, TARGET, config)(header)
    if (header.system, header.component) == (OWN, COMPONENT):
        assert not wanted
    elif name == "swarm" and header.message_id in (33, 111, 385):
        # On one link with the swarm, the target is no neighbour, and a ground station is none.
        assert wanted == (header.system in (2, 7))
    elif name == "ground":
        # The autopilot's link may be the same: it obeys nobody there but the operator.
        assert wanted or not accepted or header.system == OWN
    else:
        assert wanted or not accepted
