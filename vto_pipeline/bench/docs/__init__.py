"""The pages of the docs, made from templates and results files.

results: figures from results files
pages: templates to Markdown
prose: plain prose, checked
chosen: numbers in hand-written pages
"""
