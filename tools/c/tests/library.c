/* What the library says where nothing can be read. */
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "functions.h"

static int is_said(const char *what) {
    if (strstr(randt_bus_error(), what))
        return 1;
    fprintf(stderr, "expected \"%s\": %s\n", what, randt_bus_error());
    return 0;
}

int main(int count, char **arguments) {
    struct randt_message message;
    if (count != 2 || *randt_bus_error())
        return 1;
    if (randt_bus_open("nobody", arguments[1]) || !is_said("nobody: no stage lives there"))
        return 2;
    if (randt_bus_open("a_b", NULL) || !is_said("prefix \"a_b\""))
        return 3;
    if (randt_bus_open("\xff", NULL) || !is_said("prefix: null, or no UTF-8"))
        return 4;
    if (randt_bus_subscribe(NULL, "x", "y") || !is_said("bus: null"))
        return 5;
    if (randt_reader_receive(NULL, 0, &message) != -1 || !is_said("reader or message: null"))
        return 6;
    if (randt_reader_missed(NULL) != 0)
        return 7;
    randt_reader_close(NULL);
    randt_bus_close(NULL);
    return 0;
}
