"""Effects of inputs and outputs in words, for any system: signatures, inspections, look-alikes."""

from __future__ import annotations

from functools import partial

from pliant.interfaces.effect import EffectNotes

INPUTS = "every input of a user's own model, or those that a pattern names."
OUTPUTS = "every output of a user's own model, or those that a pattern names."
_input = partial(EffectNotes, where=INPUTS)
_output = partial(EffectNotes, where=OUTPUTS)

GAIN = _input(
    signature="the error grows in proportion to the input and vanishes where the input is zero; fast and slow runs "
    "are alike.",
    inspection="measure the acting force, torque, voltage or pressure at the largest command.",
    confounder="sensor_scale",
    distinguishing_test="move the system by a load or by its weight: a gain has no influence there, a sensor's scale "
    "has.",
    excitation="move each input through its whole range, and record the response to a known load.",
)
OFFSET = _input(
    signature="the system rests at another state than the model at zero input, in every run alike.",
    inspection="command zero and measure what acts; tare the supply or the amplifier.",
    confounder="sensor_bias",
    distinguishing_test="change the stiffness or the load: the response to an offset of the input changes with it, a "
    "sensor's bias does not.",
    excitation="record the system at zero input and at its largest inputs, each with and without a load.",
)
DEAD_ZONE = _input(
    signature="small inputs of either sign move nothing; above the threshold the input acts reduced by it.",
    inspection="raise the input slowly from zero and note where motion begins.",
    confounder="backlash",
    distinguishing_test="reverse the input far from zero: a dead zone has no influence there, a play has.",
    excitation="cycle each input in small loops about zero, and in large ones.",
)
LAG = _input(
    signature="the response to a step of the input sets in softly, and all motion is behind, the more the faster; in "
    "a hold nothing is left after a few time constants.",
    inspection="compare the acting input with the commanded one after a step.",
    confounder="sensor_lag",
    distinguishing_test="change a load while the input is constant: a lag of the input has no influence there, one of "
    "the sensor has.",
    excitation="step each input, and cycle it at several rates.",
)
DEAD_TIME = _input(
    signature="all motion sets in late by one time, at every rate; its shape is not changed.",
    inspection="trigger command and sensor by one edge and compare their times; look for buffers.",
    confounder="supply_lag",
    distinguishing_test="step an input and sample fast: a dead time moves nothing at first, a lag begins at once.",
    excitation="step every input and sample quickly.",
)
PLAY = _input(
    signature="after every reversal of the input nothing moves until it has changed by the width of the play; loops "
    "are as wide at any rate.",
    inspection="hold the input and move the output by hand: what moves freely is the play.",
    confounder="dead_zone",
    distinguishing_test="reverse the input far from zero: a play acts at every reversal, a dead zone about zero only.",
    excitation="cycle each input in small loops about several levels.",
)
SATURATION = _input(
    signature="the largest commands have no more effect than smaller ones; below a level the model is right.",
    inspection="raise the command in steps and measure what acts; read the limits of the supply.",
    confounder="actuation_gain",
    distinguishing_test="small cycles: a gain shows there, a saturation does not.",
    excitation="step the inputs to their largest values and to half of them.",
)
LEAK = _input(
    signature="the response to a step of the input fades while the command is held, at a rate in proportion to what "
    "is left.",
    inspection="hold a command for a minute and measure what acts.",
    confounder="actuation_gain",
    distinguishing_test="quick cycles: a gain shows there, a leak does not.",
    excitation="step each input and hold it for a minute.",
)
BIAS = _output(
    signature="a reading is off by one amount, at every input and rate.",
    inspection="bring the system to a known state and set the sensor's zero there.",
    confounder="input_offset",
    distinguishing_test="a second sensor, or another load: a bias stays the same.",
    excitation="record the system at rest, and at several inputs.",
)
SCALE = _output(
    signature="a reading is off by a factor, whatever causes the motion; where it is zero nothing is off.",
    inspection="bring the system to two known states and read the sensor at both.",
    confounder="actuation_gain",
    distinguishing_test="move the system by a load or by its weight: a sensor's scale shows there, a gain of the input "
    "does not.",
    excitation="move through the whole range, by the inputs and by a load.",
)
SENSOR_LAG = _output(
    signature="a reading is behind in every motion, by the same time, whatever causes the motion.",
    inspection="move the system by hand and compare a film with the reading; look for a filter in the recorder.",
    confounder="supply_lag",
    distinguishing_test="change a load while the input is constant: a sensor is late there too, an input is not.",
    excitation="step each input, then change a load while it is constant.",
)
DELAY = _output(
    signature="one sensor is late against the others by one time, at every rate.",
    inspection="knock on the system and compare the instants in all recordings.",
    confounder="sensor_lag",
    distinguishing_test="step an input: a delay keeps the shape of the reading, a lag rounds it. Where all sensors are "
    "late together, the inputs may be late.",
    excitation="do quick cycles, with all sensors read.",
)
FRAME = EffectNotes(
    signature="positions are turned about the origin of their frame: components that should be constant move.",
    inspection="move one axis of the system alone, and see whether one component of the reading moves alone.",
    distinguishing_test="angles of joints do not depend on the camera's frame: they are right.",
    excitation="move in all directions, with a camera.",
    where="models with outputs whose names end in _x_m, _y_m and _z_m, or in another unit.",
)
