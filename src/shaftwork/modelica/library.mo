  package Modelica "The classes of the Modelica Standard Library that are used here, as far as they are used"
    package Mechanics
      package Rotational
        package Interfaces
          connector Flange_a "Angle, and torque into the part"
            Real phi(unit = "rad");
            flow Real tau(unit = "N.m");
          end Flange_a;

          connector Flange_b = Flange_a;

          partial model PartialTwoFlanges
            Flange_a flange_a;
            Flange_b flange_b;
          end PartialTwoFlanges;

          partial model PartialCompliant
            extends PartialTwoFlanges;
            Real phi_rel(start = 0, unit = "rad") "Angle of b against a";
            Real tau(unit = "N.m") "Torque that b gives to a";
          equation
            phi_rel = flange_b.phi - flange_a.phi;
            flange_b.tau = tau;
            flange_a.tau = -tau;
          end PartialCompliant;
        end Interfaces;

        package Components
          model Fixed
            parameter Real phi0(unit = "rad") = 0;
            Interfaces.Flange_b flange;
          equation
            flange.phi = phi0;
          end Fixed;

          model Inertia
            extends Interfaces.PartialTwoFlanges;
            parameter Real J(min = 0, unit = "kg.m2");
            Real phi(start = 0, unit = "rad", stateSelect = StateSelect.prefer);
            Real w(start = 0, unit = "rad/s", stateSelect = StateSelect.prefer);
            Real a(unit = "rad/s2");
          equation
            phi = flange_a.phi;
            phi = flange_b.phi;
            w = der(phi);
            a = der(w);
            J * a = flange_a.tau + flange_b.tau;
          end Inertia;

          model Spring
            extends Interfaces.PartialCompliant;
            parameter Real c(min = 0, unit = "N.m/rad");
          equation
            tau = c * phi_rel;
          end Spring;

          model Damper
            extends Interfaces.PartialCompliant;
            parameter Real d(min = 0, unit = "N.m.s/rad");
          equation
            tau = d * der(phi_rel);
          end Damper;

          model SpringDamper
            extends Interfaces.PartialCompliant;
            parameter Real c(min = 0, unit = "N.m/rad");
            parameter Real d(min = 0, unit = "N.m.s/rad");
          equation
            tau = c * phi_rel + d * der(phi_rel);
          end SpringDamper;

          model IdealGear
            extends Interfaces.PartialTwoFlanges;
            parameter Real ratio(unit = "1");
          equation
            flange_a.phi = ratio * flange_b.phi;
            0 = ratio * flange_a.tau + flange_b.tau;
          end IdealGear;

          model IdealPlanetary
            parameter Real ratio(unit = "1") "Teeth of the ring over teeth of the sun";
            Interfaces.Flange_a sun;
            Interfaces.Flange_a carrier;
            Interfaces.Flange_b ring;
          equation
            (1 + ratio) * carrier.phi = sun.phi + ratio * ring.phi;
            ring.tau = ratio * sun.tau;
            carrier.tau = -(1 + ratio) * sun.tau;
          end IdealPlanetary;

          model IdealRollingWheel
            parameter Real radius(unit = "m");
            Interfaces.Flange_a flangeR;
            Translational.Interfaces.Flange_b flangeT;
          equation
            flangeR.phi * radius = flangeT.s;
            0 = radius * flangeT.f + flangeR.tau;
          end IdealRollingWheel;
        end Components;

        package Sources
          model ConstantTorque
            parameter Real tau_constant(unit = "N.m");
            Interfaces.Flange_b flange;
          equation
            flange.tau = -tau_constant;
          end ConstantTorque;

          model ConstantSpeed
            parameter Real w_fixed(unit = "rad/s");
            Interfaces.Flange_b flange;
          equation
            der(flange.phi) = w_fixed;
          end ConstantSpeed;
        end Sources;
      end Rotational;

      package Translational
        package Interfaces
          connector Flange_a "Position, and force into the part"
            Real s(unit = "m");
            flow Real f(unit = "N");
          end Flange_a;

          connector Flange_b = Flange_a;

          partial model PartialTwoFlanges
            Flange_a flange_a;
            Flange_b flange_b;
          end PartialTwoFlanges;

          partial model PartialCompliant
            extends PartialTwoFlanges;
            Real s_rel(start = 0, unit = "m") "Position of b against a";
            Real f(unit = "N") "Force that b gives to a";
          equation
            s_rel = flange_b.s - flange_a.s;
            flange_b.f = f;
            flange_a.f = -f;
          end PartialCompliant;
        end Interfaces;

        package Components
          model Fixed
            parameter Real s0(unit = "m") = 0;
            Interfaces.Flange_b flange;
          equation
            flange.s = s0;
          end Fixed;

          model Mass
            extends Interfaces.PartialTwoFlanges;
            parameter Real m(min = 0, unit = "kg");
            Real s(start = 0, unit = "m", stateSelect = StateSelect.prefer);
            Real v(start = 0, unit = "m/s", stateSelect = StateSelect.prefer);
            Real a(unit = "m/s2");
          equation
            s = flange_a.s;
            s = flange_b.s;
            v = der(s);
            a = der(v);
            m * a = flange_a.f + flange_b.f;
          end Mass;

          model Spring
            extends Interfaces.PartialCompliant;
            parameter Real c(min = 0, unit = "N/m");
          equation
            f = c * s_rel;
          end Spring;

          model Damper
            extends Interfaces.PartialCompliant;
            parameter Real d(min = 0, unit = "N.s/m");
          equation
            f = d * der(s_rel);
          end Damper;

          model SpringDamper
            extends Interfaces.PartialCompliant;
            parameter Real c(min = 0, unit = "N/m");
            parameter Real d(min = 0, unit = "N.s/m");
          equation
            f = c * s_rel + d * der(s_rel);
          end SpringDamper;
        end Components;

        package Sources
          model ConstantForce
            parameter Real f_constant(unit = "N");
            Interfaces.Flange_b flange;
          equation
            flange.f = -f_constant;
          end ConstantForce;
        end Sources;
      end Translational;
    end Mechanics;

    package Electrical
      package Analog
        package Interfaces
          connector PositivePin "Potential, and current into the part"
            Real v(unit = "V");
            flow Real i(unit = "A");
          end PositivePin;

          connector NegativePin = PositivePin;

          partial model OnePort
            PositivePin p;
            NegativePin n;
            Real v(start = 0, unit = "V");
            Real i(start = 0, unit = "A");
          equation
            v = p.v - n.v;
            0 = p.i + n.i;
            i = p.i;
          end OnePort;
        end Interfaces;

        package Basic
          model Ground
            Interfaces.PositivePin p;
          equation
            p.v = 0;
          end Ground;

          model Resistor
            extends Interfaces.OnePort;
            parameter Real R(unit = "Ohm");
          equation
            v = R * i;
          end Resistor;

          model Capacitor
            extends Interfaces.OnePort;
            parameter Real C(min = 0, unit = "F");
          equation
            i = C * der(v);
          end Capacitor;

          model Inductor
            extends Interfaces.OnePort;
            parameter Real L(unit = "H");
          equation
            L * der(i) = v;
          end Inductor;
        end Basic;

        package Ideal
          model IdealTransformer
            parameter Real n(unit = "1") "Voltage v1 over voltage v2";
            parameter Boolean considerMagnetization = false;
            Interfaces.PositivePin p1;
            Interfaces.NegativePin n1;
            Interfaces.PositivePin p2;
            Interfaces.NegativePin n2;
          equation
            0 = p1.i + n1.i;
            0 = p2.i + n2.i;
            p1.v - n1.v = n * (p2.v - n2.v);
            p2.i = -n * p1.i;
          end IdealTransformer;

          model IdealDiode
            extends Interfaces.OnePort;
            parameter Real Ron(unit = "Ohm") = 1e-5;
            parameter Real Goff(unit = "S") = 1e-5;
            Boolean off(start = true, fixed = true) "Whether it blocks";
          protected
            Real s(start = 0) "Voltage where it blocks, current where it conducts";
          equation
            off = if pre(off) then s < 1e-9 else s < -1e-9 "Rounding in a bridge does not switch it to and fro";
            v = s * (if pre(off) then 1 else Ron);
            i = s * (if pre(off) then Goff else 1);
          end IdealDiode;
        end Ideal;

        package Sources
          model ConstantVoltage
            extends Interfaces.OnePort;
            parameter Real V(unit = "V");
          equation
            v = V;
          end ConstantVoltage;

          model ConstantCurrent
            extends Interfaces.OnePort;
            parameter Real I(unit = "A");
          equation
            i = I;
          end ConstantCurrent;
        end Sources;
      end Analog;
    end Electrical;
  end Modelica;
