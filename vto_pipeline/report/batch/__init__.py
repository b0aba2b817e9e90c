"""The page of a batch.

page: the page
"""
