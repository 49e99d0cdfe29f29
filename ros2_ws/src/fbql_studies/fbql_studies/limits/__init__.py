"""Study: what limits play?"""
