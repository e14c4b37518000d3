"""x"""
def read_cad(model, path, h=None): raise NotImplementedError
