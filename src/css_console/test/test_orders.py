# SPDX-License-Identifier: Apache-2.0
"""Messages of browsers: what is no order is refused with what would be one, whatever it is."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from css_console.errors import OrderError
from css_console.orders import order_of


def test_orders_have_their_fields_and_defaults():
    order = order_of('{"id": 7, "do": "reset", "case": 12}')
    assert (order.number, order.do, order.dry) == (7, "reset", False)
    assert order.fields == {
        "mission": "", "case": 12, "estimator": "", "overrides": [], "keep": False, "paused": False
    }  # fmt: skip
    assert order_of('{"do": "pause", "dry": true}').dry


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "expected an order in JSON"),
        ("nonsense", "expected an order in JSON"),
        ("[" * 100_000, "expected an order in JSON"),
        ("[1]", "expected an object"),
        ("{}", "do: ''"),
        ('{"do": "shutdown"}', "do: 'shutdown' given, expected pause"),
        ('{"do": ["pause"]}', "do: ['pause']"),
        ('{"do": "pause", "id": -1}', "id: -1"),
        ('{"do": "pause", "id": true}', "id: True"),
        ('{"do": "pause", "dry": 1}', "dry: 1"),
        ('{"do": "pause", "node": "/ekf"}', "pause: 'node' given, expected no field"),
        ('{"do": "rate"}', "rate: rate: None given, expected a number above 0"),
        ('{"do": "rate", "rate": NaN}', "rate: rate: nan"),
        ('{"do": "rate", "rate": -1}', "rate: rate: -1"),
        ('{"do": "rate", "rate": "2"}', "rate: rate: '2'"),
        ('{"do": "seek", "time": -0.5}', "seek: time: -0.5"),
        ('{"do": "lifecycle", "node": "/gyro", "transition": "destroy"}', "expected configure or activate"),
        ('{"do": "inject", "node": "/css_array", "target": 3, "kind": "dead"}', "inject: target: 3"),
        ('{"do": "inject", "node": "/a", "target": "cell.0", "kind": "dead", "values": [true]}', "inject: values"),
        ('{"do": "reset", "case": 1.0}', "reset: case: 1.0"),
        ('{"do": "reset", "overrides": ["a=b", 1]}', "reset: overrides"),
        ('{"do": "set", "node": "/ekf", "name": "gate", "value": {"a": 1}}', "set: value"),
        ('{"do": "set", "node": "/ekf", "name": "gate", "value": null}', "set: value"),
    ],
)
def test_what_is_wrong_is_said(text, complaint):
    with pytest.raises(OrderError) as refusal:
        order_of(text)
    assert complaint in str(refusal.value)
    assert "\n" not in str(refusal.value)


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=8,
)
NAMES = st.sampled_from(["id", "do", "dry", "node", "rate", "time", "case", "values", "overrides", "target", "x"])
DOINGS = st.sampled_from(["pause", "rate", "seek", "set", "inject", "reset", "lifecycle", "clear", "history"])


@given(st.text() | ANYTHING.map(json.dumps) | st.builds(
    lambda do, fields: json.dumps({"do": do, **fields}), DOINGS, st.dictionaries(NAMES, ANYTHING, max_size=5)
))  # fmt: skip
def test_nothing_else_ever_comes_out(text):
    try:
        order = order_of(text)
    except OrderError as error:
        assert "\n" not in str(error) and len(str(error)) < 1000
    else:
        assert isinstance(order.number, int)
