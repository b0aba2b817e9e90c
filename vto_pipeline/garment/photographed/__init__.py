"""A garment held beside the photos that it was made from.

sightings: where on the mannequin the photos show cloth, and where they show it bare
covered: loops through which they show cloth, which are no openings
unsure: long loops of which neither photos nor scan tell what they are, in words
parted: cloth that the garment lacks, and whether it makes several openings of one
bridged: straps of it, put back
seen_ends: rims beyond which nothing was seen, where cloth may go on
backdrop: where they show the background beside the garment and through fillings; carved: fillings cut back to there
confirmed: fillings in the places where photos show them, once they were looked for there
"""
