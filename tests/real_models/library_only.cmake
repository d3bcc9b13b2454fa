# Included after llama.cpp's own project(): the Python package forces its common library on, and loads none of it.
set(LLAMA_BUILD_COMMON OFF)
