/* An FMU of a device brings no start values: they are those of its table of variables. */

#include "fmi_common.h"

#include <string.h>

fmi_status fmi_check_token(fmi_instance *f, const fmi_request *r)
{
    fmi_status status = FMI_OK;
    if (r->token == NULL || strcmp(r->token, gyro_token) != 0) {
        status = fmi_fail(f, r->call, "the token is %.60s, this library belongs to %s; use the modelDescription.xml of the same FMU",
                          r->token != NULL ? r->token : "NULL", gyro_token);
    }
    return status;
}
