"""Programs that the serving environment's interpreter runs; octoform hands them over by path and imports none.

They may import the standard library and FastMCP, never octoform: it is not installed where they run.
"""
