"""Study: does blending help?"""
