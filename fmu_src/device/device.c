/* What makes parameters a device that stays where it is without a force. */

#include "plant.h"

gyro_status gyro_check_device(gyro_instance *g)
{
    const double *p = g->value;
    gyro_status status = GYRO_OK;
    if (!(p[GYRO_KXX] > 0.0 && p[GYRO_KXX] * p[GYRO_KYY] > p[GYRO_KXY] * p[GYRO_KXY])) {
        status = gyro_refuse(g, "stiffness kxx = %.9g, kyy = %.9g, kxy = %.9g N/m is not positive definite: make kxx*kyy > kxy^2", p[GYRO_KXX],
                             p[GYRO_KYY], p[GYRO_KXY]);
    } else if (p[GYRO_DXX] * p[GYRO_DYY] < p[GYRO_DXY] * p[GYRO_DXY]) {
        status = gyro_refuse(g, "damping dxx = %.9g, dyy = %.9g, dxy = %.9g N.s/m feeds energy: make dxx*dyy >= dxy^2", p[GYRO_DXX],
                             p[GYRO_DYY], p[GYRO_DXY]);
    }
    return status;
}
