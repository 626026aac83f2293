"""What is optimised: problem, penalties, objectives, information, and the choice of sets."""
