"""The words of a diagnosis on effects that the model already has: whether their strength increases or not."""

from types import SimpleNamespace

from pliant_app.work import _by_kind, diagnosis_doubts

FOUND = SimpleNamespace(
    table=SimpleNamespace(rows={(): None, ("mullins",): None, ("backlash",): None}),
    judgement=SimpleNamespace(probability={("mullins",): 0.7, (): 0.295, ("backlash",): 0.005}),
)


def test_an_effect_in_the_model_is_not_called_improbable():
    assert _by_kind(FOUND, {"backlash"}) == {"mullins": 0.7}
    assert diagnosis_doubts(["backlash"], {"by_kind": _by_kind(FOUND, {"backlash"})}) == []


def test_an_effect_that_the_model_lacks_is():
    (said,) = diagnosis_doubts(["backlash"], {"by_kind": _by_kind(FOUND, ())})
    assert "'backlash' a probability of less than 1 %" in said
