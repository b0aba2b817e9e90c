"""A view of what moves now, in the browser.

codec: places of vertices as few bytes
page: the page that shows them
server: page and frames, to browsers
"""
