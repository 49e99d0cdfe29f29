"""Study: the constants of the scripted law tuned, and the bound that no law can beat."""
