"""Pages and figures: of recorded runs for `fbql report` and `fbql compare`, of an induction for `fbql induce`."""
