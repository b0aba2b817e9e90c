"""Parts of a body that are kept off others.

apart: parts that are swung off others, gently over time
parts: which: arms off trunk, head and legs, a leg off the other, the trunk off the legs
"""
