"""Numbers that decide what identification says of an arm and its recordings; docs/identify.md lists them.

Deviations are in standard deviations σ of the quantity in question, shares in the unit of what they are of.
"""

# A verdict is good or usable up to these; nMSE is of the validation, or of the training without one.
GOOD_NMSE, USABLE_NMSE = 0.02, 0.1  # mean over joints: torques are right to a seventh, and to a third
GOOD_JOINT_NMSE, USABLE_JOINT_NMSE = 0.05, 0.3  # of the worst joint, which a mean hides
GOOD_UNCERTAINTY, USABLE_UNCERTAINTY = 0.1, 0.5  # σ of torques in other motions, share of the usual torque
USABLE_NOISE = 0.1  # the same of a joint that its noise drowns, share of its torque limit
GOOD_CONDITION = 100.0  # of the scaled regressor: beyond, noise in some directions counts a hundredfold
OVERFITTED = 3.0  # nMSE of the validation over that of the training, means over joints
AS_GOOD = 1.1  # nMSE over another model's: within a tenth both predict alike
SAME_NMSE = 1e-4  # nMSE below which models are not told apart: no sensor is that good
WEAK = 0.1  # share of a joint's usual torque that one σ of a parameter makes, from which it matters
NEGATIVE = 2.0  # σ below zero of friction or a rotor, for one parameter; corrected for their number

# Residuals are noise, or show what the model lacks.
FALSE_ALARMS = 1e-3  # share of bands with pure noise that are not taken for it
EXPECTED_NOISE = 1.25  # noise over that expected from above the cut-off, which has errors of its own
LEAST_VALUES = 15.0  # independent values that a band needs for this test
CORRELATED = 4.0  # σ of the correlation of neighbours
BEYOND_CHANCE = 4.0  # what a kind of effect explains, over what it would of noise
NOTABLE_EFFECT = 0.05  # the same as a share of a joint's residual variance

# A model gets an effect on a joint if the joint's squared error on data held out, over that without it, is at
# most this for every two parameters: of several recordings, and of stretches of one, which are too alike to
# tell what holds in other motions.
WITH_EFFECT, WITH_EFFECT_IN_ONE = 0.95, 0.7

# A cause is named if it explains the misfit: shares that may remain with it, of the error or of squares.
CERTAIN = 5.0  # σ of a zero, a load, a friction, an offset or a gain: known to a fifth
EXPLAINED = 0.5  # of residuals with rotors, or another load or friction
EXPLAINED_BY_STATES = 0.7  # of residuals with other encoder zeros or gravity, in both halves of the samples
EXPLAINED_BY_COUPLING = 0.3  # of residuals with a coupling, of which many are tried
FITTING = 0.1  # of torques with another load or friction: what is left must be an arm's model
REPEATED = 0.5  # difference of a zero between the halves of the samples, relative to it
NOTABLE_ZERO = 0.05  # [rad or m] 3°: smaller ones are mounting tolerances that links make up for
NOTABLE_MASS = 0.02  # share of the arm's mass, of a load or a link
WHOLE_RATIO = 0.05  # difference from ±1 of a ratio between coupled joints that is taken for it
CONTACT = 4.0  # residual of a twelfth of a recording over the median twelfth's
FELT = 1e-6  # its mean square over the torque's variance: a thousandth of the torque or less is no contact
DRIFT = 0.7  # share of a residual's variance that a straight line in time explains
LIKE_DRIFT = 0.5  # share of time that positions explain, from which errors of the model look like drift

# What differs from the description.
DIFFERENT, NOTABLE_NMSE = 3.0, 0.005  # least nMSE of the description's links: over the model's, and as is
ODD_SCALE, ODD_SCALE_CERTAIN = 0.03, 3.0  # of a joint's torque: difference from one, and its σ
AS_DESCRIBED = 0.98  # correlation with the description's torque from which such a scale is believed
NOTABLE_OFFSET, NOTABLE_OFFSET_OF_LIMIT = 0.2, 0.02  # of a torque: share of the usual one, and of its limit
IMPLAUSIBLE_MASS = 10.0  # ratio to the description's mass, or its inverse: another unit of torques

# A load that is identified, or that identifies the drives' gains.
LOADED = 3.0  # σ of its mass
LOAD_SHOWN = 30.0  # σ of its effect on all currents, below which it may be absent
