/* A controller exported by gustform in a toy closed loop: no Python, no gustform, one folder of C.
 *
 *     gustform export controller DualPort --out controller
 *     make CONTROLLER=controller        or        cmake -S . -B build -DCONTROLLER=controller
 *
 * The plant is a sketch of a wind turbine on an island grid, in pu of the turbine: a rotor on a power curve, a
 * generator and a grid behind reactances, a capacitor between them; five times as large, a machine with a
 * governor that carries a load. The load steps up: the frequency falls, the DC voltage and the rotor speed
 * follow in proportion, and the rotor gives off energy and comes to rest where the wind gives more power. Later
 * a sensor fails for 20 samples.
 */
#include "dual_port.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>

#define MS_PER_S 1000

/* Plant parameters, pu and s. */
static const double C_DC = 0.4;         /* capacitor: C V^2/S */
static const double INERTIA = 4.6;      /* H of rotor and generator */
static const double X_GRID = 0.14;      /* filter, transformer and line */
static const double PSI = 0.83;         /* flux of the magnets */
static const double L_MACHINE = 0.33;   /* inductance of the machine */
static const double W_GRID = 314.159;   /* rad/s at nominal frequency */
static const double W_MACHINE = 114.0;  /* electrical rad/s at base speed */
static const double GRID_INERTIA = 20.; /* H of the island's machine, on the turbine's base */
static const double GOVERNOR =
    100.0; /* its power for 1 pu of frequency: a droop of 5 % of five times the turbine */

typedef struct {
    double delta; /* angle of the grid-side voltage before the grid's */
    double rho;   /* angle of the magnets before the machine-side voltage */
    double v_dc;
    double omega_r;
    double beta;
    double frequency; /* of the grid */
    double load;      /* beyond what the machine carries at nominal frequency */
    double p_grid, q_grid, p_machine, q_machine;
} plant;

/* Power curve of the rotor: best at 0.85 pu, pitch spills the rest. */
static double wind_power(double omega, double beta)
{
    const double off = (omega - 0.85) / 0.75;
    return 0.36 * (1.0 - off * off) * (1.0 - 0.04 * beta);
}

static void measure(plant *x, const dual_port_outputs *u)
{
    const double v_g = (double)u->V_gsc;
    const double v_m = (double)u->V_msc;
    x->p_grid = v_g / X_GRID * sin(x->delta);
    x->q_grid = v_g * (v_g - cos(x->delta)) / X_GRID;
    x->p_machine = PSI * v_m / L_MACHINE * sin(x->rho);
    x->q_machine = v_m * (v_m / x->omega_r - PSI * cos(x->rho)) / L_MACHINE;
}

/* One millisecond with the commands held, in steps of 50 us. */
static void advance(plant *x, const dual_port_outputs *u)
{
    const double h = 50e-6;
    for (int k = 0; k < 20; k++) {
        measure(x, u);
        x->delta += h * W_GRID * ((double)u->omega_gsc - x->frequency);
        x->rho += h * W_MACHINE * (x->omega_r - (double)u->omega_msc);
        x->v_dc += h * (x->p_machine - x->p_grid) / (C_DC * x->v_dc);
        x->omega_r += h * (wind_power(x->omega_r, x->beta) - x->p_machine) / (2.0 * INERTIA * x->omega_r);
        x->beta += h * ((double)u->beta_ref - x->beta) / 0.3;
        x->frequency += h * (x->p_grid - x->load - GOVERNOR * (x->frequency - 1.0)) / (2.0 * GRID_INERTIA);
    }
    measure(x, u);
}

static uint32_t control(dual_port_context *c, const plant *x, bool sensor_lost)
{
    c->in.v_dc = sensor_lost ? (dual_port_real)NAN : (dual_port_real)x->v_dc;
    c->in.Q_gsc = (dual_port_real)x->q_grid;
    c->in.Q_msc = (dual_port_real)x->q_machine;
    c->in.omega_r = (dual_port_real)x->omega_r;
    c->in.P_pmsg = (dual_port_real)x->p_machine;
    c->in.omega_del = (dual_port_real)1.1;
    c->in.beta_del = (dual_port_real)0.0;
    return dual_port_step(c);
}

static void show(double time, const plant *x, uint32_t errors)
{
    const int bar = (int)(60.0 * (x->p_grid - 0.3));
    (void)printf("%5.2f  %6.3f  %7.4f  %7.4f  %7.4f  %7.4f  %4x  |%.*s\n", time, 50.0 * x->frequency, x->v_dc,
                 x->omega_r, wind_power(x->omega_r, x->beta), x->p_grid, (unsigned)errors,
                 (bar < 0)    ? 0
                 : (bar > 40) ? 40
                              : bar,
                 "########################################");
}

int main(void)
{
    static dual_port_context c;
    plant x = {0.0448, 0.1276, 1.0, 1.1, 0.0, 1.0, 0.32, 0.0, 0.0, 0.0, 0.0};
    uint32_t errors = dual_port_startup(&c);
    int rejected = 0;
    double ratio = 0.0;

    /* Gains of a turbine at 8 m/s with a reserve of 10 %; all of `p` is taken over at once, or nothing. */
    c.p.K_msc = (dual_port_real)15.0;
    c.p.K_d_msc = (dual_port_real)0.2;
    errors |= dual_port_recalibrate(&c);
    if (errors != 0U) {
        (void)printf("the calibration was refused\n");
        return 1;
    }
    measure(&x, &c.out);

    (void)printf("%s, %u bytes for an instance, %g s a step\n\n",
                 sizeof(dual_port_real) == 4U ? "float" : "double", (unsigned)sizeof c, DUAL_PORT_PERIOD);
    (void)printf(" time    grid     v_dc  omega_r     wind   p_grid  error  power to the grid, from 0.3\n");
    (void)printf("    s      Hz       pu       pu       pu       pu\n");
    for (int k = 0; k < 30 * MS_PER_S; k++) {
        const bool lost = k >= 25 * MS_PER_S && k < 25 * MS_PER_S + 20;
        const bool interesting = (k >= 9750 && k <= 12000) ? k % 250 == 0 : k % 2500 == 0;
        if (k == 10 * MS_PER_S) {
            x.load += 0.5;
        }
        errors = control(&c, &x, lost);
        if (errors != 0U) {
            rejected++;
        }
        if (interesting || k == 25 * MS_PER_S + 19) {
            show(k * 1e-3, &x, errors);
        }
        advance(&x, &c.out);
    }
    ratio = ((double)c.out.omega_gsc - 1.0) / (x.v_dc - 1.0);
    (void)printf(
        "\n%d samples rejected; frequency/DC voltage = %.4f, K_gsc = %.4f; rotor/DC voltage = %.3f, K_msc = %.3f\n",
        rejected, ratio, (double)c.p.K_gsc, (x.omega_r - 1.1) / (x.v_dc - 1.0), (double)c.p.K_msc);
    /* In steady state both droops hold, the lost samples were told, and the turbine is in step with the grid.
     */
    return (rejected == 20 && fabs(ratio / (double)c.p.K_gsc - 1.0) < 1e-2 &&
            fabs((double)c.out.omega_gsc - x.frequency) < 1e-4)
               ? 0
               : 1;
}
