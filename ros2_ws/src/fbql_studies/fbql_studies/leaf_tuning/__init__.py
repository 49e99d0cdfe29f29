"""Study: behaviors and teams before and after leaf tuning."""
