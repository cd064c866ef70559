"""Keys of probes: covered by the subscription that they stand for, and known when they arrive."""

from __future__ import annotations

import pytest
import zenoh

from anafi_mav.fabric.declaration_check import is_probe, probe_of
from anafi_mav.fabric.keys import FabricKeys


@pytest.mark.parametrize(
    ("expression", "probe"),
    [
        (FabricKeys("anafi").up(7, "**"), "anafi/7/up/look"),
        (FabricKeys("field/a").down("*", "0123456789abcdef-2") + "/**", "field/a/0/down/0123456789abcdef-2/look"),
    ],
)
def test_probe_is_covered_by_its_subscription_and_is_no_key_of_the_layout(expression: str, probe: str) -> None:
    assert probe_of(expression) == probe
    assert is_probe(probe)
    assert zenoh.KeyExpr(expression).includes(zenoh.KeyExpr(probe))
    assert FabricKeys("anafi").parse(probe) is None
    assert FabricKeys("field/a").parse(probe) is None
