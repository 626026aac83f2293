"""What a cell decides for a user who does not: clearances, and regions that are asked about."""

USUAL_CLEARANCES = (0.02, 0.01, 0.005)  # [m] by default: the first that leaves room applies, or else none
KEPT_SHARE = 2 / 3  # largest share of the available distance to keep; the rest is room to move
FAR_REGION = 10.0  # reaches of the arm, beyond which a region is probably in millimetres
