"""Constraints between a few vertices.

combination: a weighted sum of four points at a place
attachment: pins that give way a little, or move
spring: springs between pairs
"""
