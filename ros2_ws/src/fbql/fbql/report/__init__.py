"""What `fbql report` and `fbql compare` make of recorded runs, and `fbql induce` of an induction: pages and figures."""
