"""Face, ears, fingers and toes for an avatar, from MakeHuman's data; the rest of its surface stays as it is.

lifelike: the avatar with them
phenotype: which of the data's shapes, in which shares, make a person of this sex, age and build
placement: head, hands and feet brought to where the avatar has its own
graft: one of them in place of the avatar's
complexion: colours of skin, hair and eyes
"""
