/* Where the FMU's resources are. */

static int hexadecimal(char c) {
  return c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
}

/* Write the path of a file from where the resources lie: a path, or in FMI 2.0 a file URI. */
static bool resource_path(const char *resources, const char *file, char *path, size_t size) {
  size_t n = 0;
  bool uri = strncmp(resources, "file:", 5) == 0;
  const char *from = uri ? resources + 5 : resources;
  if (uri && strncmp(from, "//", 2) == 0) {
    from += 2;
    if (from[0] && from[1] != ':') { /* not file://C:/, which some hosts write */
      while (*from && *from != '/') from++; /* the host, empty or localhost */
    }
  }
  if (uri && from[0] == '/' && from[1] && from[2] == ':') from++; /* /C:/... on Windows */
  for (; *from; from++) {
    int high = uri && *from == '%' ? hexadecimal(from[1]) : -1, low = high >= 0 ? hexadecimal(from[2]) : -1;
    if (n + 1 >= size) return false;
    path[n++] = low >= 0 ? (char)(16 * high + low) : *from;
    if (low >= 0) from += 2;
  }
  while (n > 1 && (path[n - 1] == '/' || path[n - 1] == '\\')) n--;
  return snprintf(path + n, size - n, "/%s", file) < (int)(size - n);
}
