def mjcf_model(*a): raise NotImplementedError
