"""x"""
def read_stl(model, path, h=None): raise NotImplementedError
