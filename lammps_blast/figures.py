def draw_figures(a, folder):
    folder.mkdir(exist_ok=True)
