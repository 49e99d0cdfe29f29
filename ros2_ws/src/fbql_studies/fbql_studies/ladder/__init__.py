"""Study: learners trained on fresh tree sets, then frozen against their controls."""
