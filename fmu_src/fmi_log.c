/* The log of an instance: errors always, life-cycle calls when asked for. */

#include "fmi_common.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

enum { LINE_SIZE = 160 + GYRO_MESSAGE_SIZE };

static const struct {
    unsigned bit;
    const char *name;
} categories_known[] = {{LOG_ERRORS, "logStatusError"}, {LOG_EVENTS, "logEvents"}, {LOG_ERRORS | LOG_EVENTS, "logAll"}};

fmi_status fmi_fail(const fmi_instance *f, const char *call, const char *why, ...)
{
    if (f != NULL && f->callback != NULL && (f->logging & LOG_ERRORS) != 0) {
        char line[LINE_SIZE];
        int n = snprintf(line, sizeof line, "%s: ", call);
        va_list arguments;
        va_start(arguments, why);
        vsnprintf(line + n, sizeof line - (size_t)n, why, arguments);
        va_end(arguments);
        f->emit(f, FMI_ERROR, "logStatusError", line);
    }
    return FMI_ERROR;
}

void fmi_report(const fmi_instance *f, const char *call, const char *event)
{
    if (f->callback != NULL && (f->logging & LOG_EVENTS) != 0) {
        char line[LINE_SIZE];
        snprintf(line, sizeof line, "%s: %s at t = %.9g s", call, event, fmi_time(f));
        f->emit(f, FMI_OK, "logEvents", line);
    }
}

fmi_status fmi_set_logging(fmi_instance *f, const char *call, int on, size_t n, const char *const categories[])
{
    fmi_status status = fmi_allow(f, call, CAN_SET_LOGGING);
    unsigned bits = n == 0 ? LOG_EVENTS | (on ? LOG_ERRORS : 0) : 0;
    if (status == FMI_OK && n > 0 && categories == NULL) {
        status = fmi_fail(f, call, "categories is NULL; pass the names of %lu categories", (unsigned long)n);
    }
    for (size_t i = 0; i < n && status == FMI_OK; i++) {
        unsigned bit = 0;
        for (size_t k = 0; k < sizeof categories_known / sizeof *categories_known; k++) {
            if (categories[i] != NULL && strcmp(categories[i], categories_known[k].name) == 0) {
                bit = categories_known[k].bit;
            }
        }
        if (bit == 0) {
            status = fmi_fail(f, call, "unknown log category %.60s; there are logStatusError, logEvents and logAll",
                              categories[i] != NULL ? categories[i] : "NULL");
        }
        bits |= bit;
    }
    if (status == FMI_OK) {
        f->logging = on ? f->logging | bits : f->logging & ~bits;
    }
    return status;
}
