"""x"""
def read_unv(model, path, h=None): raise NotImplementedError
