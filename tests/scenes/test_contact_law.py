# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contact laws: their values, their mapping, their scaling, and who takes them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose
import pytest
from rigid_gns_core import ContactLaw, Plane, RestitutionCurve, Scene, UserError
from rigid_gns_core.scenes.similarity import in_units, ModelUnits

CURVE = RestitutionCurve(0.32, 0.88, 0.33)
LAW = ContactLaw(CURVE, 0.2, 0.15, 0.005, 0.002, 0.01)
PAIR = ContactLaw(0.9, 0.06, -0.1)


def test_curve_goes_from_slow_to_fast() -> None:
    assert CURVE.at(0.0) == pytest.approx(0.32)
    assert CURVE.at(0.33) == pytest.approx(0.6)
    assert CURVE.at(1e9) == pytest.approx(0.88)
    # cushions of a carom table; the curve was fitted to these, in steps of 0.01
    assert_allclose(CURVE.at([0.2, 0.65, 1.0, 2.0]), [0.53, 0.69, 0.74, 0.8], atol=0.005)


@pytest.mark.parametrize(
    ('values', 'message'),
    [
        ({'restitution': 1.1}, 'restitution of a contact law is 1.1, expected at least 0 and at'),
        ({'restitution': 'much'}, "restitution of a contact law is 'much', expected a number"),
        ({'friction': -0.1}, 'friction of a contact law is -0.1, expected at least 0'),
        ({'tangential_restitution': -2}, 'is -2, expected at least -1 and at most 1'),
        ({'spinning_friction': np.inf}, 'is inf, expected at least 0 and finite'),
    ],
)
def test_bad_law_is_refused(values: dict, message: str) -> None:
    with pytest.raises(UserError, match=message):
        ContactLaw(**values)


def test_bad_curve_is_refused() -> None:
    with pytest.raises(UserError, match='speed of a restitution curve is 0, expected greater'):
        RestitutionCurve(0.5, 0.9, 0.0)
    with pytest.raises(UserError, match='fast of a restitution curve is 1.2'):
        RestitutionCurve(0.5, 1.2, 1.0)


def test_a_law_holds_as_it_stands() -> None:
    with pytest.raises(UserError, match='a plane has friction and a contact law.*leave friction'):
        Plane(friction=0.3, contact=LAW)
    with pytest.raises(UserError, match='contact of a plane is 0.5, expected ContactLaw'):
        Plane(contact=0.5)
    with pytest.raises(UserError, match='spinning_friction of sphere_contact is 0.1, but only'):
        Scene(sphere_contact=ContactLaw(spinning_friction=0.1))


def test_products_for_those_who_know_no_laws() -> None:
    scene = Scene(surfaces=(Plane(contact=LAW), Plane()), restitution=0.9, friction=0.5)
    assert_allclose(scene.surface_values('restitution') * 0.9, [0.88, 0.81])
    assert_allclose(scene.surface_values('friction') * 0.5, [0.2, 0.25])


def test_a_scene_with_laws_is_read_back_to_the_bit() -> None:
    scene = Scene(surfaces=Plane.box(3.0, 2.0, contact=LAW), sphere_contact=PAIR)
    assert {plane.contact for plane in scene.surfaces} == {LAW}
    assert Scene.from_mapping(scene.to_mapping()) == scene
    plain = Scene().to_mapping()
    assert not {'sphere_contact', 'air', 'inertia_factor'} & set(plain)
    assert 'contact' not in plain['surfaces'][0]
    hollow = Scene(inertia_factor=(2 / 3, 0.4))
    assert Scene.from_mapping(hollow.to_mapping()) == hollow
    boxed = Scene.from_mapping(
        {'box': {'length_x': 3.0, 'length_y': 2.0, 'contact': {'friction': 0.2}}}
    )
    assert boxed.surfaces[3].contact == ContactLaw(friction=0.2)


def test_inertia_of_no_sphere_is_refused() -> None:
    with pytest.raises(UserError, match='inertia_factor is 1, expected greater than 0 and at mo'):
        Scene(inertia_factor=1.0)


def test_laws_in_the_units_of_a_model() -> None:
    scene = Scene(surfaces=Plane(contact=LAW), sphere_contact=PAIR, radius=0.02)
    similarity, scaled = in_units(scene, ModelUnits(1.0, 9.81, 0.1))
    speed = similarity.time / similarity.length
    law = scaled.surfaces[0].contact
    assert_allclose(law.restitution.at(0.7 * speed), CURVE.at(0.7))
    assert law.rolling_friction_slope * speed == pytest.approx(0.002)
    same = replace(law, restitution=CURVE, rolling_friction_slope=0.002)
    assert (same, scaled.sphere_contact) == (LAW, PAIR)
